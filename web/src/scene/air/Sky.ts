import { BackSide, IcosahedronGeometry, Mesh, ShaderMaterial, Vector3 } from "three";
import type { Moment, Part } from "../stage/part.ts";
import type { Air } from "./air.ts";
import { SKY_FRAGMENT, SKY_VERTEX } from "./skyShader.ts";

/** The dome of the sky: gradient, sun, clouds, stars; below the horizon the haze goes on. */
export class Sky implements Part {
  readonly object: Mesh<IcosahedronGeometry, ShaderMaterial>;
  private shown = -1;
  private clouds: boolean | null = null;

  constructor(private readonly air: Air) {
    const vector = () => ({ value: new Vector3() });
    const material = new ShaderMaterial({
      vertexShader: SKY_VERTEX,
      fragmentShader: SKY_FRAGMENT,
      side: BackSide,
      depthWrite: false,
      uniforms: {
        zenith: vector(),
        horizon: vector(),
        towardsSun: vector(),
        sun: vector(),
        extinction: { value: 0 },
        night: { value: 0 },
        overcast: { value: 0 },
        drift: { value: 0 },
      },
    });
    this.object = new Mesh(new IcosahedronGeometry(1, 3), material);
    this.object.frustumCulled = false;
    this.object.renderOrder = 1000; // last of what is opaque: most of it is hidden by then
  }

  update({ camera, nowMs, quality }: Moment): void {
    const { material } = this.object;
    const uniforms = material.uniforms;
    this.object.position.copy(camera.position);
    uniforms.drift!.value = (nowMs * 1e-5) % 1000;
    if (quality.clouds !== this.clouds) {
      this.clouds = quality.clouds;
      material.defines = quality.clouds ? { CLOUDS: "" } : {};
      material.needsUpdate = true;
    }
    if (this.air.version === this.shown) return;
    this.shown = this.air.version;
    const { light } = this.air;
    for (const name of ["zenith", "horizon", "towardsSun", "sun"] as const)
      uniforms[name]!.value.set(...light[name]);
    for (const name of ["extinction", "night", "overcast"] as const)
      uniforms[name]!.value = light[name];
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}
