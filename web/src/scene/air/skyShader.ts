export const SKY_VERTEX = /* glsl */ `
varying vec3 vDirection;
void main() {
  vDirection = position;
  vec4 clip = projectionMatrix * vec4(mat3(viewMatrix) * position, 1.0);
  gl_Position = clip.xyww; // as far away as anything
}
`;

export const SKY_FRAGMENT = /* glsl */ `
varying vec3 vDirection;
uniform vec3 zenith, horizon, towardsSun, sun;
uniform float extinction, night, overcast, drift;

float hash(vec3 p) {
  p = fract(p * 0.3183099 + 0.1);
  p *= 17.0;
  return fract(p.x * p.y * p.z * (p.x + p.y + p.z));
}

float noise(vec2 p) {
  vec2 cell = floor(p), f = fract(p);
  f = f * f * (3.0 - 2.0 * f);
  float a = hash(vec3(cell, 0.0)), b = hash(vec3(cell + vec2(1, 0), 0.0));
  float c = hash(vec3(cell + vec2(0, 1), 0.0)), d = hash(vec3(cell + vec2(1, 1), 0.0));
  return mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
}

float cloud(vec2 p) {
  float sum = 0.0, part = 0.5;
  for (int i = 0; i < 4; i++) {
    sum += part * noise(p);
    p = p * 2.03 + 17.7;
    part *= 0.5;
  }
  return sum;
}

/** A star in some of the cells of a fine lattice on the sphere. */
float stars(vec3 direction) {
  vec3 p = direction * 170.0;
  vec3 cell = floor(p);
  float bright = step(0.9965, hash(cell));
  return bright * (1.0 - smoothstep(0.0, 0.45, length(fract(p) - 0.5))) * (0.4 + hash(cell + 3.0));
}

void main() {
  vec3 direction = normalize(vDirection);
  float up = max(direction.z, 0.0);
  vec3 light = mix(horizon, zenith, 1.0 - pow(1.0 - up, 3.2));
  float towards = max(dot(direction, towardsSun), 0.0);
  float clear = 1.0 - overcast;
  // glow around the sun, wide and narrow, and its disc
  light += sun * clear * (0.05 * pow(towards, 6.0) + 0.14 * pow(towards, 60.0));
  light += sun * clear * 12.0 * smoothstep(0.99985, 0.99995, towards);
  if (night > 0.0) light += vec3(0.9, 0.95, 1.0) * stars(direction) * night * clear * smoothstep(0.02, 0.25, direction.z);
#ifdef CLOUDS
  if (direction.z > 0.02) {
    vec2 over = direction.xy / (direction.z + 0.12) * 1.6 + drift;
    float amount = smoothstep(0.56 - 0.3 * overcast, 0.86 - 0.2 * overcast, cloud(over));
    vec3 lit = mix(horizon, vec3(1.0), 0.35) * (1.0 - 0.97 * night) + sun * 0.12 * clear;
    light = mix(light, lit, 0.75 * amount * smoothstep(0.02, 0.22, direction.z));
  }
#endif
  // The path through a layer of haze 400 m deep; below the horizon it never ends.
  float through = direction.z > 0.0 ? extinction * 400.0 / max(direction.z, 0.02) : 1e3;
  light = mix(horizon, light, exp(-min(through, 60.0)));
  gl_FragColor = vec4(light, 1.0);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;
