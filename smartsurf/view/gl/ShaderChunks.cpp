#include "smartsurf/view/gl/ShaderChunks.h"

#include "smartsurf/view/model/StageModel.h"

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
  vec4 sun;                 // light of the sun; w: width of a penumbra per unit of shadow-map depth, u
  vec4 sky, bounce;         // light from above and from the ground; sky.w: brightness of the lamps
  vec4 floor_paint;         // albedo of the ground; w: 1 if a grid line darkens it, −1 if it brightens it
  vec4 horizon, zenith;     // screen colours of the background; zenith.w: samples along a pixel's edge
};
)";

std::string define(const char* name, const Finish& finish) {
  std::string text = "#define " + std::string(name) + " vec4(";
  for (std::size_t i = 0; i < finish.size(); ++i) text += (i > 0 ? ", " : "") + std::to_string(finish[i]);
  return text + ")\n";
}

}  // namespace

std::string shader_preamble(RenderPass pass) {
  const char* quality = pass == RenderPass::kColourFine   ? "#define FINE\n"
                        : pass == RenderPass::kColourFast ? "#define FAST\n"
                                                          : "";
  return std::string(kFrameBlock) + quality + define("PIN_FINISH", kPinFinish) +
         define("ACTUATOR_FINISH", kActuatorFinish);
}

const char* const kLighting = R"(
uniform sampler2DShadow shadow_map;

#ifdef FINE
uniform sampler2D shadow_depth;   // the same texture without the comparison

// A spiral: the even half of it is spread over the disc, too.
const vec2 kDisc[8] = vec2[](vec2(0.250,0.000), vec2(-0.319,0.292), vec2(0.049,-0.557), vec2(0.402,0.525),
  vec2(-0.739,-0.131), vec2(0.700,-0.445), vec2(-0.234,0.870), vec2(-0.447,-0.859));

// The penumbra widens with the distance between a point and what shades it. The samples are turned from
// pixel to pixel, and average out where several samples make a pixel of the picture.
float soft_shadow(vec3 s, vec3 n) {
  // The samples lie in the plane of the face, so a wide penumbra needs no larger offset.
  vec3 along = normalize(abs(n.x) < 0.9 ? cross(n, vec3(1, 0, 0)) : cross(n, vec3(0, 1, 0)));
  float angle = 6.2832 * fract(52.9829 * fract(dot(gl_FragCoord.xy, vec2(0.06711, 0.00584))));
  vec3 across = cross(n, along);
  vec3 u = mat3(shadow_from_world) * (cos(angle) * along + sin(angle) * across);
  vec3 v = mat3(shadow_from_world) * (cos(angle) * across - sin(angle) * along);
  float depths = 0.0, found = 0.0;
  for (int i = 0; i < 8; i += 2) {
    vec3 at = s + 8.0 * ray.w * (kDisc[i].x * u + kDisc[i].y * v);
    float depth = textureLod(shadow_depth, at.xy, 0.0).r;
    if (depth < at.z) {
      depths += at.z - depth;
      found += 1.0;
    }
  }
  float radius = clamp(found > 0.0 ? depths / found * sun.w : 0.0, ray.w, 8.0 * ray.w);
  float passed = 0.0;
  for (int i = 0; i < 8; ++i) passed += texture(shadow_map, s + radius * (kDisc[i].x * u + kDisc[i].y * v));
  return passed / 8.0;
}
#endif

float sun_visibility(vec3 p, vec3 n) {
#ifdef UNSHADED
  return 1.0;
#endif
  // Offset along the normal, more at grazing light, against self-shadowing.
  float slope = 1.0 - max(dot(n, light.xyz), 0.0);
  vec3 s = (shadow_from_world * vec4(p + n * light.w * (1.0 + 2.5 * slope), 1.0)).xyz;
  if (any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)))) return 1.0;
#ifdef FINE
  return soft_shadow(s, n);
#else
  return texture(shadow_map, s);
#endif
}

// Tone mapping after Khronos' PBR Neutral: colours below four fifths of white keep their hue and brightness,
// brighter ones approach white.
vec3 tone_mapped(vec3 c) {
  const float kStart = 0.76, kRange = 1.0 - kStart;
  float peak = max(c.r, max(c.g, c.b));
  if (peak <= kStart) return c;
  float mapped = 1.0 - kRange * kRange / (peak - kStart + kRange);
  return mix(vec3(mapped), c * (mapped / peak), 1.0 / (1.0 + 0.15 * (peak - mapped)));
}

#ifdef FAST
vec3 to_screen(vec3 c) { return sqrt(tone_mapped(c)); }
#else
vec3 to_screen(vec3 c) { return pow(tone_mapped(c), vec3(1.0 / 2.2)); }
#endif

// Light from the whole sky that reaches a face.
vec3 ambient(float up) { return mix(bounce.rgb, sky.rgb, 0.5 + 0.5 * up); }

// Sunlight reaching a point: shadow-map visibility, reduced where the point sees less of the sky.
float sun_share(float visible, float open) { return visible * (0.35 + 0.65 * open); }

vec3 lit(vec3 albedo, vec3 n, vec3 p, float open) {
  vec3 c = ambient(n.z) * open;
  float facing = dot(n, light.xyz);
  if (facing > 0.0) c += sun.rgb * facing * sun_share(sun_visibility(p, n), open);
  return to_screen(c * albedo);
}

// The surroundings that a surface of this roughness mirrors: ground, sky, a lamp above, a strip light behind.
vec3 environment(vec3 d, float rough) {
  float blur = 0.06 + 0.8 * rough;
  vec3 c = mix(bounce.rgb, sky.rgb, smoothstep(-blur, blur, d.z));
  float lamp = smoothstep(0.80 - 0.7 * blur, 0.86 + 0.3 * blur, dot(d, normalize(vec3(-0.35, -0.15, 0.92))));
  float strip = smoothstep(0.90 - 0.8 * blur, 0.96 + 0.3 * blur, dot(d, normalize(vec3(0.75, 0.60, 0.28))));
  return c + sky.w * vec3(1.0, 0.98, 0.95) * (lamp + 0.8 * strip) / (1.0 + 6.0 * rough);
}

// look: roughness, share of metal, reflectance head-on, pattern (Finish in StageModel.h).
vec3 lit_material(vec3 albedo, vec3 n, vec3 p, float open, vec4 look) {
  vec3 back = normalize(eye.xyz - p);
  float rough = look.x;
  vec3 head_on = mix(vec3(look.z), albedo, look.y), own = albedo * (1.0 - look.y);
  float grazing = 1.0 - max(dot(n, back), 0.0);
  float grazing2 = grazing * grazing;
  vec3 mirrored = head_on + max(vec3(1.0 - rough) - head_on, 0.0) * (grazing2 * grazing2 * grazing);
  vec3 c = (ambient(n.z) * own + environment(reflect(-back, n), rough) * mirrored) * open;
  float facing = dot(n, light.xyz);
  if (facing > 0.0) {
    float power = 2.0 / (rough * rough * rough + 0.002);
    float shine = pow(max(dot(n, normalize(light.xyz + back)), 0.0), power) * (0.08 * power + 0.6);
    c += sun.rgb * facing * (own + mirrored * shine) * sun_share(sun_visibility(p, n), open);
  }
  return to_screen(c);
}

// The albedo of wood at a point of an object: rings around an axis beside it, and fibres.
vec3 grain(vec3 albedo, vec3 at, float size) {
  vec3 q = at / size;
  float wobble = 0.12 * sin(3.1 * q.z + 1.7 * q.x) + 0.05 * sin(7.3 * q.z);
  float ring = 7.0 * length(q.xy + vec2(1.4 + wobble, 0.5));
  float dark = fract(ring);
  dark = smoothstep(0.25, 0.95, dark) * (1.0 - smoothstep(0.95, 1.0, dark));
  float fibre = 0.5 + 0.5 * sin(60.0 * q.x + 8.0 * sin(21.0 * q.y) + 3.0 * q.z);
  return albedo * mix(1.08, 0.58, dark) * mix(0.95, 1.03, fibre);
}

#ifndef FAST
// Acrylic leaves out some samples of each pixel, more where it is seen head-on; zenith.w² samples make one.
bool see_through(vec4 look, float facing) {
  const int kOrder2[4] = int[](0, 2, 3, 1), kOrder3[9] = int[](0, 5, 2, 7, 3, 8, 4, 1, 6);
  if (look.w < 1.5 || zenith.w < 1.5) return false;
  int samples = int(zenith.w);
  ivec2 at = ivec2(gl_FragCoord.xy) % samples;
  int turn = samples == 2 ? kOrder2[2 * at.y + at.x] : kOrder3[3 * at.y + at.x];
  return float(turn) + 0.5 > mix(0.98, 0.45, pow(facing, 0.6)) * float(samples * samples);
}
#endif
)";

const char* const kObjectAttributes = R"(
layout(location = 1) in vec3 centre;
layout(location = 2) in vec3 half_extent;
layout(location = 3) in vec4 orientation;
layout(location = 4) in vec4 colour;         // linear light; w: mean z of the pins around the object
layout(location = 6) in vec4 finish;         // look, as lit_material() takes it
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
