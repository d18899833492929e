#include "smartsurf/view/gl/ShaderChunks.h"

namespace smartsurf::view {
namespace {

// Mirrors FrameUniforms in Renderer.cpp (std140).
constexpr const char* kFrameBlock = R"(#version 330 core
layout(std140) uniform Frame {
  mat4 clip_from_world;
  mat4 shadow_from_world;   // to texture coordinates and depth, 0 … 1
  vec4 eye;                 // w: 1 for a perspective projection, 0 for a parallel one along `ray`
  vec4 ray;                 // view direction; w: penumbra radius, u
  vec4 light;               // unit vector towards the light; w: size of a shadow-map texel, u
  vec4 fog;                 // start and end distance from the eye, u; zw: image size, pixels
  vec4 table;               // x0, y0, x1, y1 of the table
};
)";

}  // namespace

std::string shader_preamble(RenderPass pass) {
  const char* define = pass == RenderPass::kColourFine   ? "#define FINE\n"
                       : pass == RenderPass::kColourFast ? "#define FAST\n"
                                                         : "";
  return std::string(kFrameBlock) + define;
}

const char* const kLighting = R"(
uniform sampler2DShadow shadow_map;
const vec3 kSun = vec3(1.02, 0.99, 0.93) * 0.96;
const vec3 kSky = vec3(0.56, 0.62, 0.72) * 0.82;
const vec3 kBounce = vec3(0.34, 0.32, 0.30) * 0.8;

float sun_visibility(vec3 p, vec3 n) {
#ifdef UNSHADED
  return 1.0;
#endif
  // Offset along the normal, more at grazing light, against self-shadowing.
  float slope = 1.0 - max(dot(n, light.xyz), 0.0);
  vec3 s = (shadow_from_world * vec4(p + n * light.w * (1.0 + 2.5 * slope), 1.0)).xyz;
  if (any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)))) return 1.0;
#ifdef FINE
  const vec2 kDisc[12] = vec2[](vec2(-0.326,-0.406), vec2(-0.840,-0.074), vec2(-0.696,0.457), vec2(-0.203,0.621),
    vec2(0.962,-0.195), vec2(0.473,-0.480), vec2(0.519,0.767), vec2(0.185,-0.893), vec2(0.507,0.064),
    vec2(0.896,0.412), vec2(-0.322,-0.933), vec2(-0.792,-0.598));
  // The samples lie in the plane of the face, so a wide penumbra needs no larger offset.
  vec3 along = normalize(abs(n.x) < 0.9 ? cross(n, vec3(1, 0, 0)) : cross(n, vec3(0, 1, 0)));
  vec3 u = mat3(shadow_from_world) * along * ray.w, v = mat3(shadow_from_world) * cross(n, along) * ray.w;
  float sum = 0.0;
  for (int i = 0; i < 12; ++i) sum += texture(shadow_map, s + kDisc[i].x * u + kDisc[i].y * v);
  return sum / 12.0;
#else
  return texture(shadow_map, s);
#endif
}

#ifdef FAST
vec3 to_screen(vec3 c) { return sqrt(min(c, vec3(1.0))); }
#else
vec3 to_screen(vec3 c) { return pow(min(c, vec3(1.0)), vec3(1.0 / 2.2)); }
#endif

// Sunlight reaching a point: shadow-map visibility, reduced where the point sees less of the sky.
float sun_share(float visible, float sky) { return visible * (0.35 + 0.65 * sky); }

vec3 lit(vec3 albedo, vec3 n, vec3 p, float sky) {
  vec3 c = mix(kBounce, kSky, 0.5 + 0.5 * n.z) * sky;   // hemispheric ambient light
  float facing = dot(n, light.xyz);
  if (facing > 0.0) c += kSun * facing * sun_share(sun_visibility(p, n), sky);
  c *= albedo;
  return to_screen(c / (1.0 + 0.12 * c));
}

vec3 lit_glossy(vec3 albedo, vec3 n, vec3 p, float sky, float gloss) {
  vec3 c = mix(kBounce, kSky, 0.5 + 0.5 * n.z) * sky * albedo;
  float facing = dot(n, light.xyz);
  if (facing > 0.0) {
    float sun = sun_share(sun_visibility(p, n), sky);
    float shine = max(dot(n, normalize(light.xyz + normalize(eye.xyz - p))), 0.0);
    c += kSun * (albedo * facing + gloss * pow(shine, 48.0)) * sun;
  }
  return to_screen(c / (1.0 + 0.12 * c));
}
)";

const char* const kObjectAttributes = R"(
layout(location = 1) in vec3 centre;
layout(location = 2) in vec3 half_extent;
layout(location = 3) in vec4 orientation;
layout(location = 4) in vec4 colour;         // linear light; w: mean z of the pins around the object
vec3 rotate(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
// A mesh corner in the object's frame.
vec3 placed(vec3 corner) {
#ifdef CAPSULE
  return corner * half_extent.x + vec3(0.0, 0.0, sign(corner.z) * (half_extent.z - half_extent.x));
#else
  return corner * half_extent;
#endif
}
)";

const char* const kPocketOcclusion = R"(
float pocket_sky(vec3 p, float rim, float size) {
  float depth = clamp((rim - p.z) / size, 0.0, 1.0);
  return 1.0 - 0.55 * depth;
}
)";

const char* const kEmptyFragment = "void main() {}\n";

}  // namespace smartsurf::view
