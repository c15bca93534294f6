"""What running scripts reach outside the box: TCP sockets and XML-RPC servers."""
