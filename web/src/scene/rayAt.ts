import { Raycaster, Vector2, type Camera } from "three";

type Vector = [number, number, number];

const caster = new Raycaster();

/** The ray below a point of the page, in the map; `direction` is a unit vector. */
export function rayAt(
  canvas: HTMLElement,
  camera: Camera,
  clientX: number,
  clientY: number,
): { origin: Vector; direction: Vector } {
  const box = canvas.getBoundingClientRect();
  const x = ((clientX - box.left) / box.width) * 2 - 1;
  const y = 1 - ((clientY - box.top) / box.height) * 2;
  caster.setFromCamera(new Vector2(x, y), camera);
  const { origin: o, direction: d } = caster.ray;
  return { origin: [o.x, o.y, o.z], direction: [d.x, d.y, d.z] };
}
