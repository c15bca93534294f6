"""What all ports share: listening, connections, and the descriptor that is kept free to refuse clients."""
