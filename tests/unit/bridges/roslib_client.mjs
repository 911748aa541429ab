// What npm's roslib sees of a rosbridge server; prints its findings as JSON.
import { Action, Param, Ros, Service, Topic } from "roslib";

const ros = new Ros();
await ros.connect(process.argv[2]);
const found = {};
const scan = (options) => new Topic({ ros, name: "/scan", messageType: "sensor_msgs/LaserScan", ...options });
const first = (topic) =>
  new Promise((resolve) => {
    const take = (message) => {
      topic.unsubscribe(take);
      resolve(message);
    };
    topic.subscribe(take);
  });
const call = (name, serviceType, request) =>
  new Promise((resolve, reject) =>
    new Service({ ros, name, serviceType }).callService(request, resolve, reject),
  );

found.none = (await first(scan({}))).ranges;
const typed = (await first(scan({ compression: "cbor" }))).ranges;
found.cbor = [typed.constructor.name, typed[0], String(typed[1]), typed[2]];
found.png = (await first(scan({ compression: "png" }))).ranges;
found.raw = (await first(scan({ compression: "cbor-raw" }))).bytes.length;

const echoed = first(new Topic({ ros, name: "/echoed", messageType: "std_msgs/String" }));
const echo = new Topic({ ros, name: "/echo", messageType: "std_msgs/String" });
echo.advertise();
echo.publish({ data: "grüße 🚁" });
found.echo = (await echoed).data;

found.arm = await call("/arm", "std_srvs/SetBool", { data: true });
found.failed = await call("/nobody", "std_srvs/Trigger", {}).catch(String);
const mine = new Service({ ros, name: "/mine", serviceType: "std_srvs/Trigger" });
await mine.advertise((request, response) => {
  response.success = true;
  response.message = "by roslib";
  return true;
});
found.mine = await call("/mine", "std_srvs/Trigger", {});
found.topics = (await new Promise((resolve, reject) => ros.getTopics(resolve, reject))).topics;

const parameter = new Param({ ros, name: "/thing" });
await new Promise((resolve, reject) => parameter.set({ a: 1 }, resolve, reject));
found.parameter = await new Promise((resolve, reject) => parameter.get(resolve, reject));

const action = new Action({
  ros,
  name: "/step",
  actionType: "simulation_interfaces/action/SimulateSteps",
});
found.result = await new Promise((resolve, reject) =>
  action.sendGoal({ steps: 1 }, resolve, (feedback) => (found.feedback = feedback), reject),
);
console.log(JSON.stringify(found));
ros.close();
process.exit(0);
