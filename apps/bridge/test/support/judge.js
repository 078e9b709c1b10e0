// Watches and commands a fleet by Foxglove's own client, and prints what came, a line each.
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

const client = new FoxgloveClient({
  ws: new WebSocket(process.argv[2], [FoxgloveClient.SUPPORTED_SUBPROTOCOL]),
});
const wanted = new Set(["/tf", "/map", "/mag1/pose", "parameters", "1", "2"]);
const topics = new Map();
const services = new Map();
const text = (data) => Buffer.from(data.buffer, data.byteOffset, data.byteLength).toString();
const encode = (value) => new TextEncoder().encode(JSON.stringify(value));
const say = (...words) => console.log(words.join(" "));

function done(what) {
  wanted.delete(what);
  if (wanted.size === 0) process.exit(0);
}

function call(name, callId, request) {
  const data = new DataView(encode(request).buffer);
  client.sendServiceCallRequest({ serviceId: services.get(name), callId, encoding: "json", data });
}

client.on("error", (error) => say("error", error.message));
client.on("status", (status) => say("status", status.message));
client.on("serverInfo", (info) => say("info", info.name));
client.on("advertise", (channels) => {
  for (const channel of channels) {
    if (channel.schema !== "") JSON.parse(channel.schema);
    topics.set(client.subscribe(channel.id), channel.topic);
    say("channel", channel.topic, channel.schemaName);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  JSON.parse(text(data));
  if (Math.abs(Number(timestamp / 1000000n) - Date.now()) > 60000) say("error", "time");
  say("message", topics.get(subscriptionId));
  done(topics.get(subscriptionId));
});
client.on("advertiseServices", (offered) => {
  for (const service of offered) services.set(service.name, service.id);
  client.getParameters([], "all");
  call("/goto", 1, { robot: "mag1", x: 1, y: 2 });
  const drive = client.advertise({ topic: "/mag1/cmd_vel", encoding: "json", schemaName: "geometry_msgs/Twist" });
  client.sendMessage(drive, encode({ linear: { x: 0.2, y: 0, z: 0 }, angular: { x: 0, y: 0, z: 0 } }));
});
client.on("parameterValues", ({ parameters }) => {
  for (const { name, value } of parameters) say("parameter", name, value);
  done("parameters");
});
client.on("serviceCallResponse", (answer) => {
  const [name] = [...services].find(([, id]) => id === answer.serviceId);
  say("service", name, answer.callId, text(answer.data));
  if (answer.callId === 1) call("/estop", 2, {});
  done(`${answer.callId}`);
});
client.on("serviceCallFailure", (failure) => say("failure", failure.message));
setTimeout(() => { say("error", `nothing came of ${[...wanted].join(", ")}`); process.exit(1); }, 20000);
