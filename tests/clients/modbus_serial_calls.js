// Calls of modbus-serial, the Modbus client for Node.js, in a process of their own.
//
//     node modbus_serial_calls.js connectTCP HOST PORT '[["setID", 65], ["readHoldingRegisters", 275, 1], ...]'
//
// prints a list of what they returned as JSON: the data of a read, the answer to a write, the code of an exception of
// the server. "untilFree" is none of its calls: it reads the status of an OnRobot gripper until that has power and is
// not busy.

const ModbusRTU = require("modbus-serial");

const [connect, host, port, calls] = process.argv.slice(2);
const STATUS = 0x010c, BUSY = 1, NO_POWER = 4;

async function untilFree(client) {
  for (;;) {
    try {
      const [status] = (await client.readHoldingRegisters(STATUS, 1)).data;
      if (!(status & BUSY)) return status;
    } catch (error) {
      if (error.modbusCode !== NO_POWER) throw error;
    }
  }
}

async function main() {
  const client = new ModbusRTU();
  client.setTimeout(60_000); // ms; a limit for hangs
  await client[connect](host, { port: Number(port) });
  const results = [];
  for (const [name, ...args] of JSON.parse(calls)) {
    try {
      const result = await (name === "untilFree" ? untilFree(client) : client[name](...args));
      results.push(result?.data ?? result ?? null);
    } catch (error) {
      if (!error.modbusCode) throw error;
      results.push({ exception: error.modbusCode });
    }
  }
  console.log(JSON.stringify(results));
  client.close(() => {});
}

main();
