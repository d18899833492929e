#include "smartsurf/view/Shaders.h"

namespace smartsurf::view {
namespace {

// Mirrors FrameUniforms in Renderer.cpp (std140).
constexpr const char* kFrame = R"(#version 330 core
layout(std140) uniform Frame {
  mat4 clip_from_world;
  mat4 shadow_from_world;   // to texture coordinates and depth, 0 … 1
  vec4 eye;                 // w: 1 for a perspective eye, 0 when every ray runs along `ray`
  vec4 ray;                 // direction of view of a parallel projection; w: radius of the shadows' soft edge, u
  vec4 light;               // unit vector towards the light; w: world size of one texel of the shadow map
  vec4 fog;                 // start and end distance from the eye; zw: size of the picture in pixels
  vec4 table;               // x0, y0, x1, y1 of the table
};
)";

constexpr const char* kLighting = R"(
uniform sampler2DShadow shadow_map;
const vec3 kSun = vec3(1.02, 0.99, 0.93) * 0.96;
const vec3 kSky = vec3(0.56, 0.62, 0.72) * 0.82;
const vec3 kBounce = vec3(0.34, 0.32, 0.30) * 0.8;

float sun_visibility(vec3 p, vec3 n) {
  // Along the normal, by more where the light grazes: else a face shades itself.
  float slope = 1.0 - max(dot(n, light.xyz), 0.0);
  vec3 s = (shadow_from_world * vec4(p + n * light.w * (1.0 + 2.5 * slope), 1.0)).xyz;
  if (any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)))) return 1.0;
#ifdef FINE
  const vec2 kDisc[12] = vec2[](vec2(-0.326,-0.406), vec2(-0.840,-0.074), vec2(-0.696,0.457), vec2(-0.203,0.621),
    vec2(0.962,-0.195), vec2(0.473,-0.480), vec2(0.519,0.767), vec2(0.185,-0.893), vec2(0.507,0.064),
    vec2(0.896,0.412), vec2(-0.322,-0.933), vec2(-0.792,-0.598));
  // The samples lie in the plane of the face: a wide edge then needs no wide margin against self-shading.
  vec3 along = normalize(abs(n.x) < 0.9 ? cross(n, vec3(1, 0, 0)) : cross(n, vec3(0, 1, 0)));
  vec3 u = mat3(shadow_from_world) * along * ray.w, v = mat3(shadow_from_world) * cross(n, along) * ray.w;
  float sum = 0.0;
  for (int i = 0; i < 12; ++i) sum += texture(shadow_map, s + kDisc[i].x * u + kDisc[i].y * v);
  return sum / 12.0;
#else
  return texture(shadow_map, s);
#endif
}

vec3 to_screen(vec3 c) { return pow(min(c, vec3(1.0)), vec3(1.0 / 2.2)); }

vec3 lit(vec3 albedo, vec3 n, vec3 p, float sky) {
  vec3 c = mix(kBounce, kSky, 0.5 + 0.5 * n.z) * sky;
  float facing = dot(n, light.xyz);
  if (facing > 0.0) c += kSun * facing * sun_visibility(p, n) * (0.35 + 0.65 * sky);
  c *= albedo;
  return to_screen(c / (1.0 + 0.12 * c));
}

vec3 lit_glossy(vec3 albedo, vec3 n, vec3 p, float sky, float gloss) {
  vec3 c = mix(kBounce, kSky, 0.5 + 0.5 * n.z) * sky * albedo;
  float facing = dot(n, light.xyz);
  if (facing > 0.0) {
    float sun = sun_visibility(p, n) * (0.35 + 0.65 * sky);
    float shine = max(dot(n, normalize(light.xyz + normalize(eye.xyz - p))), 0.0);
    c += kSun * (albedo * facing + gloss * pow(shine, 48.0)) * sun;
  }
  return to_screen(c / (1.0 + 0.12 * c));
}
)";

constexpr const char* kPinVertex = R"(
layout(location = 0) in vec4 corner;      // x, y: ±1, z: 0 foot, 1 top, w: 0 top, 1 side in x, 2 side in y
layout(location = 1) in float height;
layout(location = 2) in vec4 colour;
layout(location = 3) in vec4 corner_sky;
layout(location = 4) in vec4 neighbour;
layout(location = 5) in vec3 place;       // centre, turn about z
uniform vec4 pin;       // half top x, half top y, length, pitch
uniform float base;
uniform float sunk;     // how far below its neighbour's top a side is drawn
out vec3 world;
flat out vec3 normal;
flat out vec3 albedo;
flat out vec2 levels;   // z where the pin ends and its shaft begins; z of the top beside this side
out float sky;
void main() {
  float cosine = cos(place.z), sine = sin(place.z);
  mat2 turn = mat2(cosine, sine, -sine, cosine);
  // Only the two sides that can face the eye are drawn.
  vec2 towards = transpose(turn) * (eye.w > 0.5 ? eye.xy - place.xy : -ray.xy);
  vec2 s = vec2(towards.x < 0.0 ? -1.0 : 1.0, towards.y < 0.0 ? -1.0 : 1.0);
  vec2 at = corner.xy * s;
  normal = corner.w < 0.5 ? vec3(0, 0, 1) : vec3(turn * (corner.w < 1.5 ? vec2(s.x, 0) : vec2(0, s.y)), 0);
  albedo = colour.rgb;
  float beside = corner.w < 1.5 ? (s.x < 0.0 ? neighbour.x : neighbour.y)
                                : (s.y < 0.0 ? neighbour.z : neighbour.w);
  float foot = colour.a > 0.5 ? base : max(base, min(beside, height) - sunk);
  world = vec3(place.xy + turn * (at * pin.xy), corner.z > 0.5 ? height : min(foot, height));
  levels = vec2(height - pin.z, corner.w < 0.5 ? -1e30 : beside);
  sky = at.y < 0.0 ? (at.x < 0.0 ? corner_sky.x : corner_sky.y) : (at.x < 0.0 ? corner_sky.z : corner_sky.w);
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kPinFragment = R"(
in vec3 world;
flat in vec3 normal;
flat in vec3 albedo;
flat in vec2 levels;
in float sky;
uniform vec4 pin;
uniform float base;
out vec4 pixel;
void main() {
  float open = sky;
  vec3 c = albedo;
  if (normal.z < 0.5) {
    float below = (levels.y - world.z) / pin.w;                    // in the gap beside a neighbour
    open *= below > 0.0 ? 0.55 / (1.0 + 3.0 * below) : clamp(0.55 - 0.35 * below, 0.55, 1.0);
    if (world.z < levels.x) c *= 0.55;                             // the shaft under the pin
  }
  pixel = vec4(lit(c, normal, world, open), 1.0);
}
)";

constexpr const char* kObjectInputs = R"(
layout(location = 1) in vec3 centre;
layout(location = 2) in vec3 half_extent;
layout(location = 3) in vec4 orientation;
layout(location = 4) in vec4 colour;         // linear light; w: z of the pins around the object
vec3 rotate(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
// A corner of the mesh in the object's own frame.
vec3 placed(vec3 corner) {
#ifdef CAPSULE
  return corner * half_extent.x + vec3(0.0, 0.0, sign(corner.z) * (half_extent.z - half_extent.x));
#else
  return corner * half_extent;
#endif
}
)";

// How much of the sky an object's surface sees from inside a pocket whose rim is at z = rim.
constexpr const char* kPocket = R"(
float pocket_sky(vec3 p, float rim, float size) {
  float depth = clamp((rim - p.z) / size, 0.0, 1.0);
  return 1.0 - 0.55 * depth;
}
)";

constexpr const char* kSphereVertex = R"(
layout(location = 0) in vec2 corner;
out vec3 world;
flat out vec4 ball;     // centre, radius
flat out vec4 paint;    // colour, rim
flat out vec4 spin;
void main() {
  float radius = half_extent.x;
  vec3 back = -ray.xyz;
  float reach = radius;
  if (eye.w > 0.5) {
    vec3 d = eye.xyz - centre;
    float distance2 = max(dot(d, d), radius * radius * 1.0001);
    back = d * inversesqrt(distance2);
    reach = radius * sqrt(distance2 / (distance2 - radius * radius));   // of the silhouette, seen at the centre
  }
  vec3 side = normalize(abs(back.z) < 0.99 ? cross(vec3(0, 0, 1), back) : cross(vec3(0, 1, 0), back));
  world = centre + (side * corner.x + cross(back, side) * corner.y) * reach;
  ball = vec4(centre, radius);
  paint = colour;
  spin = orientation;
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

// The light sees a sphere as a flat disc through its centre: the same outline, and no point that the light
// can reach lies behind it. So no depth need be computed a pixel.
constexpr const char* kSphereShadowFragment = R"(
in vec3 world;
flat in vec4 ball;
void main() {
  vec3 offset = world - ball.xyz;
  if (dot(offset, offset) > ball.w * ball.w) discard;
}
)";

constexpr const char* kSphereFragment = R"(
in vec3 world;
flat in vec4 ball;
flat in vec4 paint;
flat in vec4 spin;
out vec4 pixel;
vec3 unrotate(vec4 q, vec3 v) { return v + 2.0 * cross(-q.xyz, cross(-q.xyz, v) + q.w * v); }
void main() {
  vec3 direction = normalize(world - eye.xyz);
  vec3 offset = world - ball.xyz;
  float b = dot(offset, direction);
  float under = b * b - dot(offset, offset) + ball.w * ball.w;
  if (under < 0.0) discard;
  vec3 hit = world - direction * (b + sqrt(under));
  vec4 clip = clip_from_world * vec4(hit, 1.0);
  gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
  vec3 n = (hit - ball.xyz) / ball.w;
  // A thin lighter band around the equator shows how the ball rolls.
  float latitude = abs(unrotate(spin, n).z);
  vec3 c = mix(paint.rgb, vec3(1.0), 0.22 * (1.0 - smoothstep(0.04, 0.07, latitude)));
  pixel = vec4(lit_glossy(c, n, hit, pocket_sky(hit, paint.w, 1.6 * ball.w), 0.22), 1.0);
}
)";

constexpr const char* kMeshVertex = R"(
layout(location = 0) in vec3 corner;
layout(location = 5) in vec3 corner_normal;
out vec3 world;
out vec3 normal;
flat out vec4 paint;
flat out float size;
void main() {
  world = centre + rotate(orientation, placed(corner));
#ifdef CAPSULE
  normal = rotate(orientation, corner_normal);
#else
  normal = rotate(orientation, normalize(corner_normal / half_extent));
#endif
  paint = colour;
  size = min(half_extent.x, min(half_extent.y, half_extent.z));
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kMeshFragment = R"(
in vec3 world;
in vec3 normal;
flat in vec4 paint;
flat in float size;
out vec4 pixel;
void main() {
  pixel = vec4(lit_glossy(paint.rgb, normalize(normal), world, pocket_sky(world, paint.w, 2.0 * size), 0.12), 1.0);
}
)";

constexpr const char* kWireVertex = R"(
layout(location = 0) in vec3 corner;
out vec4 paint;
void main() {
  vec3 world = centre + rotate(orientation, placed(corner));
  vec3 out_of_surface = normalize(rotate(orientation, corner));
  // Lines on the far side are fainter, so that the shape reads.
  float near = dot(out_of_surface, normalize(eye.xyz - world)) > 0.0 ? 1.0 : 0.35;
  paint = vec4(pow(colour.rgb, vec3(1.0 / 2.2)) * 0.85, near);
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kPartVertex = R"(
layout(location = 0) in vec3 corner;
layout(location = 1) in vec3 corner_normal;
layout(location = 2) in float weight;      // of the second colour
layout(location = 3) in vec3 x;            // the part's axes, scaled
layout(location = 4) in vec3 y;
layout(location = 5) in vec3 z;
layout(location = 6) in vec3 centre;
layout(location = 7) in vec4 paint;
layout(location = 8) in vec4 mark;
out vec3 world;
out vec3 normal;
out vec4 colour;
void main() {
  world = centre + x * corner.x + y * corner.y + z * corner.z;
  normal = cross(y, z) * corner_normal.x + cross(z, x) * corner_normal.y + cross(x, y) * corner_normal.z;
  colour = mix(paint, mark, weight);
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kPartFragment = R"(
in vec3 world;
in vec3 normal;
in vec4 colour;
out vec4 pixel;
void main() {
  if (colour.a < 0.99)
    pixel = vec4(to_screen(colour.rgb), colour.a);
  else
    pixel = vec4(lit_glossy(colour.rgb, normalize(normal), world, 0.95, 0.08), 1.0);
}
)";

constexpr const char* kGroundVertex = R"(
layout(location = 0) in vec2 corner;
uniform float base;
uniform float reach;
out vec3 world;
void main() {
  world = vec3(0.5 * (table.xy + table.zw) + corner * reach, base);
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kSkyColours = R"(
vec3 backdrop(float y) { return mix(vec3(0.86, 0.88, 0.905), vec3(0.965, 0.972, 0.98), clamp(y, 0.0, 1.0)); }
)";

constexpr const char* kGroundFragment = R"(
in vec3 world;
uniform float spacing;   // of the grid's lines; 0: no grid
out vec4 pixel;
float line(float at, float width) {
  float d = abs(fract(at - 0.5) - 0.5) / max(fwidth(at), 1e-6);
  return 1.0 - smoothstep(width, width + 1.0, d);
}
void main() {
  vec3 n = vec3(0, 0, 1);
  vec2 out_of_table = max(max(table.xy - world.xy, world.xy - table.zw), 0.0);
  float sky = 0.62 + 0.38 * smoothstep(0.0, 6.0, length(out_of_table));
  vec3 c = lit(vec3(0.66, 0.675, 0.70), n, world, sky);
  if (spacing > 0.0) {
    vec2 at = world.xy / spacing;
    float fine = max(line(at.x, 0.0), line(at.y, 0.0)) * (1.0 - smoothstep(0.08, 0.35, max(fwidth(at.x), fwidth(at.y))));
    c = mix(c, c * 0.86, fine);
  }
  float far = smoothstep(fog.x, fog.y, length(world - eye.xyz));
  pixel = vec4(mix(c, backdrop(gl_FragCoord.y / fog.w), far), 1.0);
}
)";

std::string defines(Pass pass) { return pass == Pass::kColourFine ? "#define FINE\n" : ""; }

std::string head(Pass pass) { return kFrame + defines(pass); }

std::string shape_define(bool capsule) { return capsule ? "#define CAPSULE\n" : ""; }

constexpr const char* kEmptyFragment = "void main() {}\n";

}  // namespace

ShaderSources pin_shaders(Pass pass) {
  return {head(pass) + kPinVertex,
          head(pass) +
              (pass == Pass::kShadow ? std::string(kEmptyFragment) : std::string(kLighting) + kPinFragment)};
}

ShaderSources sphere_shaders(Pass pass) {
  return {head(pass) + kObjectInputs + kSphereVertex,
          head(pass) + (pass == Pass::kShadow ? std::string(kSphereShadowFragment)
                                              : std::string(kLighting) + kPocket + kSphereFragment)};
}

ShaderSources mesh_shaders(Pass pass, bool capsule) {
  return {head(pass) + shape_define(capsule) + kObjectInputs + kMeshVertex,
          head(pass) + (pass == Pass::kShadow ? std::string(kEmptyFragment)
                                              : std::string(kLighting) + kPocket + kMeshFragment)};
}

ShaderSources wire_shaders(bool capsule) {
  return {head(Pass::kColour) + shape_define(capsule) + kObjectInputs + kWireVertex,
          "#version 330 core\nin vec4 paint;\nout vec4 pixel;\nvoid main() { pixel = paint; }\n"};
}

ShaderSources part_shaders(Pass pass) {
  return {head(pass) + kPartVertex,
          head(pass) +
              (pass == Pass::kShadow ? std::string(kEmptyFragment) : std::string(kLighting) + kPartFragment)};
}

ShaderSources line_shaders() {
  return {head(Pass::kColour) + R"(
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in vec4 colour;
uniform vec3 picture;    // its size and the lines' width, in pixels
out vec4 paint;
const float kNear = 1e-3;
void main() {
  vec4 a = clip_from_world * vec4(from, 1.0), b = clip_from_world * vec4(to, 1.0);
  // What is behind the eye is cut off before the division by w.
  if (a.w < kNear && b.w >= kNear) a = mix(a, b, (kNear - a.w) / (b.w - a.w));
  else if (b.w < kNear && a.w >= kNear) b = mix(b, a, (kNear - b.w) / (a.w - b.w));
  vec2 along = (b.xy / b.w - a.xy / a.w) * picture.xy;
  along = dot(along, along) > 1e-8 ? normalize(along) : vec2(1.0, 0.0);
  vec4 end = gl_VertexID < 2 ? a : b;
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  end.xy += vec2(-along.y, along.x) * side * picture.z / picture.xy * end.w;
  end.z -= 2e-4 * end.w;   // lines that lie on a surface are not half hidden by it
  paint = colour;
  gl_Position = end;
}
)",
          "#version 330 core\nin vec4 paint;\nout vec4 pixel;\nvoid main() { pixel = paint; }\n"};
}

ShaderSources ground_shaders(Pass pass) {
  return {head(pass) + kGroundVertex, head(pass) + kLighting + kSkyColours + kGroundFragment};
}

ShaderSources backdrop_shaders() {
  return {head(Pass::kColour) + R"(
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 1.0, 1.0); }
)",
          head(Pass::kColour) + kSkyColours + R"(
out vec4 pixel;
void main() { pixel = vec4(backdrop(gl_FragCoord.y / fog.w), 1.0); }
)"};
}

ShaderSources average_shaders() {
  return {R"(#version 330 core
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
)",
          R"(#version 330 core
uniform sampler2D picture;
uniform int block;
out vec4 pixel;
void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * block;
  vec4 sum = vec4(0.0);
  for (int y = 0; y < block; ++y)
    for (int x = 0; x < block; ++x) sum += texelFetch(picture, first + ivec2(x, y), 0);
  pixel = sum / float(block * block);
}
)"};
}

}  // namespace smartsurf::view
