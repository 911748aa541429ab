// Which curves an x-y plot begins with, and which are alike.

interface Named {
  name: string;
  type: string;
}

/** A number of a topic's messages. */
export interface Line {
  topic: string;
  type: string;
  /** As `pose.pose.position.z`. */
  path: string;
}

/** One number over another one. */
export interface Curve {
  x: Line;
  y: Line;
}

const ODOMETRY = /^nav_msgs\/(msg\/)?Odometry$/;

/** Where a UAV is, seen from above: by `/NAME/odom`, or another topic with its odometry; else none. */
export function positionCurve(topics: readonly Named[], uav: string): Curve[] {
  const own = topics.filter(
    ({ name, type }) => ODOMETRY.test(type) && (uav === "" || name.startsWith(`/${uav}/`)),
  );
  const found = own.find(({ name }) => name === `/${uav}/odom`) ?? own[0];
  if (found === undefined) return [];
  const line = (axis: string): Line => ({
    topic: found.name,
    type: found.type,
    path: `pose.pose.position.${axis}`,
  });
  return [{ x: line("x"), y: line("y") }];
}

/** The same curve of every UAV: of all topics that differ only in the first part of their name. */
export function alikeCurves(topics: readonly Named[], { x, y }: Curve): Curve[] {
  const [uav, restOfX] = splitName(x.topic);
  const [other, restOfY] = splitName(y.topic);
  if (uav !== other) return [{ x, y }];
  const has = (name: string, type: string) =>
    topics.some((topic) => topic.name === name && topic.type === type);
  const names = topics
    .map(({ name }) => splitName(name))
    .filter(([, rest]) => rest === restOfY)
    .map(([name]) => name);
  return [...new Set(names)]
    .filter((name) => has(`/${name}${restOfX}`, x.type) && has(`/${name}${restOfY}`, y.type))
    .map((name) => ({
      x: { ...x, topic: `/${name}${restOfX}` },
      y: { ...y, topic: `/${name}${restOfY}` },
    }));
}

/** `/uav1/odom` as `uav1` and `/odom`. */
function splitName(topic: string): [string, string] {
  const [, first = "", rest = ""] = /^\/([^/]+)(\/.*)?$/.exec(topic) ?? [];
  return [first, rest];
}
