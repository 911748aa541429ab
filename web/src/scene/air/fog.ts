// Distance fog as it is in the air: what is left of a contrast is exp(-extinction distance), with the
// true distance instead of the depth, mixed as light and before tone mapping. three's own fog is
// squared and mixed into the finished image; these pieces of its shaders are replaced for
// all materials, before the first of them is compiled.

import { FogExp2, ShaderChunk } from "three";

const LIGHT = /* glsl */ `
#ifdef USE_FOG
	#ifdef FOG_EXP2
		float kept = exp( - fogDensity * length( vFogPosition ) );
	#else
		float kept = 1.0 - smoothstep( fogNear, fogFar, length( vFogPosition ) );
	#endif
	gl_FragColor.rgb = mix( hazeLight, gl_FragColor.rgb, kept );
#endif
`;

/** The haze as light: three gives the colour as the screen wants it. */
const HAZE = /* glsl */ `
#ifdef USE_FOG
	vec3 hazeLight = sRGBTransferEOTF( vec4( fogColor, 1.0 ) ).rgb;
#endif
`;

// Distances are taken at each pixel: along the sides of a large triangle they do not grow evenly.
for (const chunk of ["fog_pars_vertex", "fog_pars_fragment"] as const)
  ShaderChunk[chunk] = ShaderChunk[chunk].replace(
    "varying float vFogDepth",
    "varying vec3 vFogPosition",
  );
ShaderChunk.fog_vertex = /* glsl */ `
#ifdef USE_FOG
	vFogPosition = mvPosition.xyz;
#endif
`;
ShaderChunk.opaque_fragment += HAZE + LIGHT;
ShaderChunk.fog_fragment = "";

/** For shaders of our own: after `gl_FragColor` is set, as light. */
export const FADE = HAZE + LIGHT;

/** The scene's fog; its density is the extinction in 1/m. */
export function makeFog(): FogExp2 {
  return new FogExp2(0xffffff, 0);
}
