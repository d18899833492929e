#include "smartsurf/view/gl/Shaders.h"

#include "smartsurf/view/gl/ShaderChunks.h"

namespace smartsurf::view {
namespace {

constexpr const char* kMeshVertex = R"(
layout(location = 0) in vec3 corner;
layout(location = 5) in vec3 corner_normal;
out vec3 world;
out vec3 normal;
flat out vec4 paint;
flat out float size;
flat out vec4 look;
out vec3 own;           // position in the object's frame
void main() {
  world = centre + rotate(orientation, placed(corner));
#ifdef CAPSULE
  normal = rotate(orientation, corner_normal);
#else
  normal = rotate(orientation, normalize(corner_normal / half_extent));
#endif
  paint = colour;
  look = finish;
  own = placed(corner);
  size = min(half_extent.x, min(half_extent.y, half_extent.z));
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kMeshFragment = R"(
in vec3 world;
in vec3 normal;
flat in vec4 paint;
flat in float size;
flat in vec4 look;
in vec3 own;
out vec4 pixel;
void main() {
  vec3 n = normalize(normal), c = paint.rgb;
  float open = pocket_sky(world, paint.w, 2.0 * size);
#ifdef FAST
  pixel = vec4(lit(c, n, world, open), 1.0);
#else
  if (see_through(look, abs(dot(n, normalize(eye.xyz - world))))) discard;
  if (look.w > 0.5 && look.w < 1.5) c = grain(c, own.yzx, 1.2 * size);
  pixel = vec4(lit_material(c, n, world, open, look), 1.0);
#endif
}
)";

// The colour of the halo that sets off a line from any background.
constexpr const char* kHalo = R"(
vec3 halo(vec3 screen) { return vec3(dot(screen, vec3(0.30, 0.59, 0.11)) > 0.45 ? 0.05 : 1.0); }
)";

constexpr const char* kWireframeVertex = R"(
uniform float is_halo;   // 1: the halo of the wires
layout(location = 0) in vec3 corner;
out vec4 paint;
void main() {
  vec3 world = centre + rotate(orientation, placed(corner));
  vec3 out_of_surface = normalize(rotate(orientation, corner));
  // Lines on the far side are fainter, which shows the shape.
  float near = dot(out_of_surface, normalize(eye.xyz - world)) > 0.0 ? 1.0 : 0.35;
  vec3 screen = pow(colour.rgb, vec3(1.0 / 2.2)) * 0.85;
  paint = is_halo > 0.5 ? vec4(halo(screen), 0.75 * near * near) : vec4(screen, near);
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kTwoColourVertex = R"(
layout(location = 0) in vec3 corner;
layout(location = 1) in vec3 corner_normal;
layout(location = 2) in float weight;      // share of the accent colour
layout(location = 3) in vec3 x;            // scaled axes of the instance
layout(location = 4) in vec3 y;
layout(location = 5) in vec3 z;
layout(location = 6) in vec3 centre;
layout(location = 7) in vec4 paint;
layout(location = 8) in vec4 mark;
out vec4 colour;
#ifndef FAST
out vec3 world;
out vec3 normal;
#endif
void main() {
  vec3 p = centre + x * corner.x + y * corner.y + z * corner.z;
  vec3 n = cross(y, z) * corner_normal.x + cross(z, x) * corner_normal.y + cross(x, y) * corner_normal.z;
  colour = mix(paint, mark, weight);
#ifdef FAST
  colour.rgb = colour.a < 0.99 ? to_screen(colour.rgb) : lit(colour.rgb, normalize(n), p, 0.95);
#else
  world = p;
  normal = n;
#endif
  gl_Position = clip_from_world * vec4(p, 1.0);
}
)";

constexpr const char* kTwoColourFragment = R"(
#ifdef FAST
in vec4 colour;
out vec4 pixel;
void main() { pixel = colour; }
#else
in vec3 world;
in vec3 normal;
in vec4 colour;
out vec4 pixel;
void main() {
  if (colour.a < 0.99)
    pixel = vec4(to_screen(colour.rgb), colour.a);
  else
    pixel = vec4(lit_material(colour.rgb, normalize(normal), world, 0.95, ACTUATOR_FINISH), 1.0);
}
#endif
)";

constexpr const char* kGroundVertex = R"(
layout(location = 0) in vec2 corner;   // ±1: of the shaded rectangle; ±2: of the whole ground
uniform float base;     // z of the ground
uniform float reach;    // half the ground's edge
uniform vec4 shaded;    // x0, y0, x1, y1 of the ground that shadows may fall on
out vec3 world;
#ifdef UNSHADED
flat out vec3 plain;    // lit colour, constant outside the shaded rectangle
#endif
void main() {
  vec2 near = mix(shaded.xy, shaded.zw, step(0.0, corner));
  vec2 far = 0.5 * (table.xy + table.zw) + reach * sign(corner);
  world = vec3(abs(corner.x) > 1.5 ? far : near, base);
#ifdef UNSHADED
  plain = lit(floor_paint.rgb, vec3(0, 0, 1), world, 1.0);
#endif
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kBackdropFunction = R"(
vec3 backdrop(float y) { return mix(horizon.rgb, zenith.rgb, clamp(y, 0.0, 1.0)); }
)";

constexpr const char* kGroundFragment = R"(
in vec3 world;
#ifdef UNSHADED
flat in vec3 plain;
#endif
uniform float spacing;   // between grid lines, u; 0: no grid
uniform float darkened;  // width of the ground around the table that it darkens, u
out vec4 pixel;
void main() {
#ifdef UNSHADED
  vec3 c = plain;
#else
  vec2 out_of_table = max(max(table.xy - world.xy, world.xy - table.zw), 0.0);
  float sky = 0.62 + 0.38 * smoothstep(0.0, darkened, length(out_of_table));
  vec3 c = lit(floor_paint.rgb, vec3(0, 0, 1), world, sky);
#endif
  if (spacing > 0.0) {
    vec2 at = world.xy / spacing, pixel_wide = fwidth(at);
    vec2 line = smoothstep(0.0, 1.0, 1.0 - abs(fract(at - 0.5) - 0.5) / max(pixel_wide, 1e-6));
    c *= 1.0 - floor_paint.w * 0.1 * max(line.x, line.y) *
                   (1.0 - smoothstep(0.08, 0.35, max(pixel_wide.x, pixel_wide.y)));
  }
#ifdef FAST
  float away = 1.0 / gl_FragCoord.w;   // view-space depth
#else
  float away = length(world - eye.xyz);
#endif
  float far = smoothstep(fog.x, fog.y, away);
  pixel = vec4(mix(c, backdrop(gl_FragCoord.y / fog.w), far), 1.0 - far);
}
)";

constexpr const char* kFullScreenVertex = R"(#version 330 core
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
)";

std::string shape_define(bool capsule) { return capsule ? "#define CAPSULE\n" : ""; }

}  // namespace

ShaderSources mesh_shaders(RenderPass pass, bool capsule) {
  return {shader_preamble(pass) + shape_define(capsule) + kObjectAttributes + kMeshVertex,
          shader_preamble(pass) + (pass == RenderPass::kShadow
                                       ? std::string(kEmptyFragment)
                                       : std::string(kLighting) + kPocketOcclusion + kMeshFragment)};
}

ShaderSources wireframe_shaders(bool capsule) {
  return {shader_preamble(RenderPass::kColour) + shape_define(capsule) + kObjectAttributes + kHalo +
              kWireframeVertex,
          "#version 330 core\nin vec4 paint;\nout vec4 pixel;\nvoid main() { pixel = paint; }\n"};
}

ShaderSources two_colour_mesh_shaders(RenderPass pass) {
  const std::string head = shader_preamble(pass);
  switch (pass) {
    case RenderPass::kShadow:
      return {head + kTwoColourVertex, head + kEmptyFragment};
    case RenderPass::kColourFast:
      return {head + kLighting + kTwoColourVertex, head + kTwoColourFragment};
    default:
      return {head + kTwoColourVertex, head + kLighting + kTwoColourFragment};
  }
}

ShaderSources line_shaders() {
  return {shader_preamble(RenderPass::kColour) + kHalo + R"(
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in vec4 colour;
uniform vec3 picture;    // viewport size and line width, pixels
uniform vec2 style;      // 1: the halo; opacity
out vec4 paint;
const float kNear = 1e-3;
void main() {
  vec4 a = clip_from_world * vec4(from, 1.0), b = clip_from_world * vec4(to, 1.0);
  // Clip at the eye before the division by w.
  if (a.w < kNear && b.w >= kNear) a = mix(a, b, (kNear - a.w) / (b.w - a.w));
  else if (b.w < kNear && a.w >= kNear) b = mix(b, a, (kNear - b.w) / (a.w - b.w));
  vec2 along = (b.xy / b.w - a.xy / a.w) * picture.xy;
  along = dot(along, along) > 1e-8 ? normalize(along) : vec2(1.0, 0.0);
  vec4 end = gl_VertexID < 2 ? a : b;
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  end.xy += vec2(-along.y, along.x) * side * picture.z / picture.xy * end.w;
  end.z -= 2e-4 * end.w;   // against z-fighting with the surface the line lies on
  paint = vec4(style.x > 0.5 ? halo(colour.rgb) : colour.rgb, colour.a * style.y);
  if (style.x > 0.5) end.z += 1e-4 * end.w;   // behind its line
  gl_Position = end;
}
)",
          "#version 330 core\nin vec4 paint;\nout vec4 pixel;\nvoid main() { pixel = paint; }\n"};
}

ShaderSources ground_shaders(RenderPass pass, bool shadowed) {
  const std::string head = shader_preamble(pass) + (shadowed ? "" : "#define UNSHADED\n");
  return {head + (shadowed ? "" : kLighting) + kGroundVertex,
          head + kLighting + kBackdropFunction + kGroundFragment};
}

ShaderSources backdrop_shaders() {
  return {shader_preamble(RenderPass::kColour) + R"(
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 1.0, 1.0); }
)",
          shader_preamble(RenderPass::kColour) + kBackdropFunction + R"(
out vec4 pixel;
void main() { pixel = vec4(backdrop(gl_FragCoord.y / fog.w), 0.0); }
)"};
}

ShaderSources occlusion_shaders() {
  return {kFullScreenVertex, R"(#version 330 core
uniform sampler2D depths;   // of the samples
uniform vec4 lens;          // x, y: half the picture's edges at distance 1; z, w: entries of the projection
uniform vec4 reach;         // radius, u, and in pixels at distance 1; pixels at most; samples along a pixel's edge
out vec4 pixel;
// Beside the picture nothing is near.
float distance_at(ivec2 at) {
  ivec2 size = textureSize(depths, 0), centre = at * int(reach.w) + int(reach.w) / 2;
  if (any(lessThan(centre, ivec2(0))) || any(greaterThanEqual(centre, size))) return 1e6;
  return lens.w / (2.0 * texelFetch(depths, centre, 0).r - 1.0 + lens.z);
}
vec3 position(ivec2 at) {
  float away = distance_at(at);
  vec2 size = vec2(textureSize(depths, 0)) / reach.w;
  return vec3(((vec2(at) + 0.5) / size * 2.0 - 1.0) * lens.xy, -1.0) * away;
}
// The difference to the nearer of two neighbours lies in the surface at the pixel, also at its edge.
vec3 slope(vec3 p, vec3 before, vec3 after) {
  return abs(before.z - p.z) < abs(after.z - p.z) ? p - before : after - p;
}
// Scalable ambient obscurance (McGuire et al., 2012): points of a spiral around the pixel that lie above its
// tangent plane. Each counts by the sine of its elevation, so that a small hollow is no darker than a large one.
void main() {
  const int kSamples = 14;
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec3 p = position(at);
  vec3 x = slope(p, position(at - ivec2(1, 0)), position(at + ivec2(1, 0)));
  vec3 y = slope(p, position(at - ivec2(0, 1)), position(at + ivec2(0, 1)));
  vec3 n = normalize(cross(x, y));
  float disc = min(reach.y / -p.z, reach.z), radius2 = reach.x * reach.x;
  ivec2 cell = at & 3;
  float turn = 0.3927 * float((cell.x * 5 + cell.y * 10 + (cell.x >> 1)) & 15);
  float sum = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    float share = (float(i) + 0.5) / float(kSamples), angle = turn + 2.39996 * float(i);
    vec3 v = position(at + ivec2(round(share * disc * vec2(cos(angle), sin(angle))))) - p;
    float d2 = dot(v, v), near = max(radius2 - d2, 0.0) / radius2;
    sum += near * near * near * max(dot(v, n) - 0.01 * reach.x, 0.0) * inversesqrt(d2 + 0.003 * radius2);
  }
  pixel = vec4(clamp(1.0 - 3.0 * sum / float(kSamples), 0.0, 1.0), -p.z, 0.0, 1.0);
}
)"};
}

ShaderSources resolve_shaders() {
  return {kFullScreenVertex, R"(#version 330 core
uniform sampler2D picture;     // alpha: share of the colour that is subject to occlusion
uniform sampler2D occlusion;   // visibility of the surroundings, distance from the eye
uniform int block;
uniform float occluded;        // 0: no occlusion was drawn
out vec4 pixel;
// The mean over the 4 × 4 pixels that share the spiral's turns, without those of other surfaces.
float visibility(ivec2 at) {
  ivec2 last = textureSize(occlusion, 0) - 1;
  float away = texelFetch(occlusion, at, 0).g, sum = 0.0, weights = 0.0;
  for (int y = -2; y < 2; ++y)
    for (int x = -2; x < 2; ++x) {
      vec2 other = texelFetch(occlusion, clamp(at + ivec2(x, y), ivec2(0), last), 0).rg;
      float weight = max(0.0, 1.0 - 60.0 * abs(other.g - away) / away) + 1e-4;
      sum += weight * other.r;
      weights += weight;
    }
  return sum / weights;
}
void main() {
  float open = occluded > 0.5 ? pow(visibility(ivec2(gl_FragCoord.xy)), 0.8) : 1.0;
  ivec2 first = ivec2(gl_FragCoord.xy) * block;
  vec3 sum = vec3(0.0);
  for (int y = 0; y < block; ++y)
    for (int x = 0; x < block; ++x) {
      vec4 c = texelFetch(picture, first + ivec2(x, y), 0);
      sum += c.rgb * mix(1.0, open, c.a);
    }
  pixel = vec4(sum / float(block * block), 1.0);
}
)"};
}

}  // namespace smartsurf::view
