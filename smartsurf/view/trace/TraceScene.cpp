#include "smartsurf/view/trace/TraceScene.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <span>
#include <stdexcept>
#include <utility>

#include "smartsurf/view/model/ActuatorGeometry.h"
#include "smartsurf/view/model/Meshes.h"
#include "smartsurf/view/model/PinShading.h"
#include "smartsurf/view/model/TableBounds.h"
#include "smartsurf/view/trace/Maths.h"
#include "smartsurf/view/trace/PinMesh.h"

namespace smartsurf::view {
namespace {

using Vec = Eigen::Vector3f;
using Mat = Eigen::Matrix3f;
using scene::ShapeKind;

constexpr int kSegments = 64;          // around round shapes
constexpr float kShaftAlbedo = 0.55F;  // of the shaft, relative to the pin
constexpr float kGapAlbedo = 0.15F;    // in the gaps of the outermost ring, relative to its pins
constexpr float kGridLineWidth_px = 1.2F;
constexpr float kBandShare = 0.22F;  // of white in the band around a sphere's equator

template <void (*kRelease)(RTCScene)>
struct Releaser {
  void operator()(RTCScene scene) const { kRelease(scene); }
};
using SceneHandle = std::unique_ptr<RTCSceneTy, Releaser<rtcReleaseScene>>;
struct DeviceReleaser {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};

Vec rgb(const std::array<std::uint8_t, 4>& c) { return Vec(c[0], c[1], c[2]) / 255.0F; }

float mix(float a, float b, float share) { return a + (b - a) * share; }

// Wood: as grain() in ShaderChunks.cpp.
Vec grain(const Vec& albedo, const Vec& at, float size) {
  const Vec q = at / size;
  const float wobble = 0.12F * std::sin(3.1F * q.z() + 1.7F * q.x()) + 0.05F * std::sin(7.3F * q.z());
  const float ring = 7.0F * std::hypot(q.x() + 1.4F + wobble, q.y() + 0.5F), turn = ring - std::floor(ring);
  const float dark = smoothstep(0.25F, 0.95F, turn) * (1.0F - smoothstep(0.95F, 1.0F, turn));
  const float fibre = 0.5F + 0.5F * std::sin(60.0F * q.x() + 8.0F * std::sin(21.0F * q.y()) + 3.0F * q.z());
  return albedo * mix(1.08F, 0.58F, dark) * mix(0.95F, 1.03F, fibre);
}

// Triangles with what is interpolated over them: 6 floats per vertex as in Mesh, or 7 as in TwoColourMesh.
struct MeshTree {
  std::vector<float> vertices;
  std::vector<std::uint32_t> indices;
  int stride = 6;
  SceneHandle scene;
};

// One mesh, placed in the world.
struct Placed {
  const MeshTree* mesh;
  Mat axes, normals;  // to the world, of points and of normals
  Vec centre;
  Vec base, accent;
  float base_opacity = 1.0F, accent_opacity = 1.0F;
  Finish finish;
  float size = 1.0F;
  bool unlit = false;
};

struct Ball {
  Vec centre, albedo;
  float radius;
  Finish finish;
  Eigen::Quaternionf orientation;
};

RTCRay ray_from(const Vec& origin, const Vec& direction, unsigned sets) {
  return {.org_x = origin.x(),
          .org_y = origin.y(),
          .org_z = origin.z(),
          .tnear = 0.0F,
          .dir_x = direction.x(),
          .dir_y = direction.y(),
          .dir_z = direction.z(),
          .time = 0.0F,
          .tfar = std::numeric_limits<float>::infinity(),
          .mask = sets,
          .id = 0,
          .flags = 0};
}

}  // namespace

struct TraceScene::State {
  explicit State(const scene::SceneSpec& s)
      : spec(s), shading(s.surface), actuators(s.surface), device(rtcNewDevice("threads=1,set_affinity=0")) {
    if (!device) throw std::runtime_error("Embree cannot be started on this processor");
  }

  RTCGeometry triangles(const float* vertices, std::size_t vertex_count, int stride,
                        std::span<const std::uint32_t> indices) const;
  const MeshTree& tree(MeshTree& mesh) const;
  const MeshTree& shape_mesh(const scene::ObjectSpec& object);
  // Makes it part of the frame; returns its number.
  unsigned attach(RTCGeometry geometry, unsigned sets);
  void place(const Placed& placed, unsigned sets);
  void add_pins(std::span<const PinInstance> instances, float cell_px);
  void close_outermost_gaps();
  void add_objects(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue);
  void add_balls(const std::vector<Ball>& added, unsigned sets);
  void add_actuators();
  void add_ground();
  void add_lines(const DrawOptions& options, const Camera& camera, float pixel_slope);

  void read_pin(const RTCHit& hit, SurfacePoint& point) const;
  void read_ball(const Ball& ball, SurfacePoint& point) const;
  void read_placed(const Placed& placed, const RTCHit& hit, SurfacePoint& point) const;
  void read_ground(SurfacePoint& point) const;

  scene::SceneSpec spec;
  PinShading shading;
  ActuatorGeometry actuators;
  std::unique_ptr<RTCDeviceTy, DeviceReleaser> device;
  std::map<ShapeKind, MeshTree> shapes;
  std::map<std::pair<double, double>, MeshTree> capsules;  // by radius and height
  std::map<std::shared_ptr<const scene::Solid>, MeshTree> solids;
  std::vector<MeshTree> actuator_meshes;

  // The frame's geometry.
  SceneHandle frame;
  struct Part {
    enum class Kind { kPins, kBalls, kPlaced, kGround, kLines } kind;
    std::size_t first;  // index of its first ball, or of the placed mesh
  };
  std::vector<Part> parts;  // by number of the geometry
  std::vector<Placed> placed_meshes;
  std::vector<Ball> balls;
  std::vector<std::array<std::uint8_t, 4>> line_colours;
  std::span<const PinInstance> pins;
  PinMesh pin_mesh;
  Vec floor_paint;
  float grid = 0.0F, grid_spacing = 0.0F, pixel_slope = 0.0F;
};

RTCGeometry TraceScene::State::triangles(const float* vertices, std::size_t vertex_count, int stride,
                                         std::span<const std::uint32_t> indices) const {
  RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* const positions = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertex_count));
  auto* const corners = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), indices.size() / 3));
  if (!positions || !corners) throw std::bad_alloc();
  for (std::size_t i = 0; i < vertex_count; ++i) std::copy_n(vertices + i * stride, 3, positions + 3 * i);
  std::copy(indices.begin(), indices.end(), corners);
  return geometry;
}

const MeshTree& TraceScene::State::tree(MeshTree& mesh) const {
  mesh.scene.reset(rtcNewScene(device.get()));
  rtcSetSceneFlags(mesh.scene.get(), RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry =
      triangles(mesh.vertices.data(), mesh.vertices.size() / mesh.stride, mesh.stride, mesh.indices);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(mesh.scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(mesh.scene.get());
  return mesh;
}

const MeshTree& TraceScene::State::shape_mesh(const scene::ObjectSpec& object) {
  const auto make = [this](MeshTree& kept, Mesh mesh) -> const MeshTree& {
    kept.vertices = std::move(mesh.vertices);
    kept.indices = std::move(mesh.indices);
    return tree(kept);
  };
  if (object.shape == ShapeKind::kSolid) {
    MeshTree& kept = solids[object.solid];
    return kept.scene ? kept : make(kept, solid_mesh(*object.solid));
  }
  if (object.shape == ShapeKind::kCapsule) {
    MeshTree& kept = capsules[{object.radius, object.height}];
    if (kept.scene) return kept;
    Mesh mesh = capsule_mesh(kSegments);
    const Vec half = object.half_extents().cast<float>();
    for (std::size_t i = 0; i < mesh.vertices.size(); i += 6) {
      const float end = std::copysign(half.z() - half.x(), mesh.vertices[i + 2]);
      for (std::size_t k = 0; k < 3; ++k) mesh.vertices[i + k] *= half.x();
      mesh.vertices[i + 2] += end;
    }
    return make(kept, std::move(mesh));
  }
  MeshTree& kept = shapes[object.shape];
  if (kept.scene) return kept;
  return make(kept, object.shape == ShapeKind::kBox        ? box_mesh()
                    : object.shape == ShapeKind::kCylinder ? cylinder_mesh(kSegments)
                                                           : cone_mesh(kSegments));
}

unsigned TraceScene::State::attach(RTCGeometry geometry, unsigned sets) {
  rtcSetGeometryMask(geometry, sets);
  rtcCommitGeometry(geometry);
  const unsigned number = rtcAttachGeometry(frame.get(), geometry);
  rtcReleaseGeometry(geometry);
  parts.resize(std::max<std::size_t>(parts.size(), number + 1));
  return number;
}

void TraceScene::State::place(const Placed& placed, unsigned sets) {
  RTCGeometry instance = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(instance, placed.mesh->scene.get());
  Eigen::Matrix<float, 3, 4> to_world;
  to_world << placed.axes, placed.centre;
  rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, to_world.data());
  parts[attach(instance, sets)] = {Part::Kind::kPlaced, placed_meshes.size()};
  placed_meshes.push_back(placed);
}

void TraceScene::State::add_pins(std::span<const PinInstance> instances, float cell_px) {
  pins = instances;
  if (pins.empty()) return;
  const scene::SurfaceSpec& s = spec.surface;
  const auto [half_x, half_y] = prism_half_edges(s);
  pin_mesh = PinMesh(half_x, half_y, cell_px < 20.0F ? 1 : cell_px < 80.0F ? 2 : 4);
  const auto ground = static_cast<float>(s.ground_height());
  RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* position =
      static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                  3 * sizeof(float), pins.size() * pin_mesh.vertices.size()));
  auto* corner = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t),
                              pins.size() * pin_mesh.triangles.size()));
  if (!position || !corner) throw std::bad_alloc();
  std::uint32_t first = 0;
  for (const PinInstance& pin : pins) {
    for (const PinMesh::Vertex& vertex : pin_mesh.vertices) {
      const auto [cosine, sine] = pin.rotation;
      *position++ = pin.position[0] + cosine * vertex.place.x() - sine * vertex.place.y();
      *position++ = pin.position[1] + sine * vertex.place.x() + cosine * vertex.place.y();
      *position++ = vertex.foot ? std::min(ground, pin.height) : pin.height + vertex.place.z();
    }
    for (const auto& triangle : pin_mesh.triangles)
      for (const std::uint32_t vertex : triangle) *corner++ = first + vertex;
    first += static_cast<std::uint32_t>(pin_mesh.vertices.size());
  }
  parts[attach(geometry, kOpaque)] = {Part::Kind::kPins, 0};
}

// The background must not show through narrow gaps of the outermost ring: dark walls stand inside it.
void TraceScene::State::close_outermost_gaps() {
  const scene::SurfaceSpec& s = spec.surface;
  if (!s.has_narrow_gaps()) return;
  scene::ObjectSpec box;
  box.shape = ShapeKind::kBox;
  const auto ground = static_cast<float>(s.ground_height()), half_pitch = static_cast<float>(s.pitch / 2.0),
             thickness = 0.2F * static_cast<float>(std::min(s.pin.top_x, s.pin.top_y));
  const auto edge_x = (static_cast<float>(s.columns) - 1.5F) * static_cast<float>(s.pitch),
             edge_y = (static_cast<float>(s.rows) - 1.5F) * static_cast<float>(s.pitch);
  for (const PinInstance& pin : pins) {
    if (pin.colour[3] == 0) continue;
    const float half_height = 0.5F * (pin.height - 2.0F * thickness - ground);
    if (half_height <= 0.0F) continue;
    const auto [x, y] = pin.position;
    for (const bool along_x : {true, false}) {
      if (along_x ? y > half_pitch && y < edge_y : x > half_pitch && x < edge_x) continue;
      const Vec half(along_x ? half_pitch : thickness, along_x ? thickness : half_pitch, half_height);
      const Vec albedo = kGapAlbedo * rgb(pin.colour);
      place({.mesh = &shape_mesh(box),
             .axes = half.asDiagonal(),
             .normals = half.cwiseInverse().asDiagonal(),
             .centre = {x, y, ground + half_height},
             .base = albedo,
             .accent = albedo,
             .finish = kPinFinish},
            kOpaque);
    }
  }
}

void TraceScene::State::add_balls(const std::vector<Ball>& added, unsigned sets) {
  if (added.empty()) return;
  RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_SPHERE_POINT);
  auto* point = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), added.size()));
  if (!point) throw std::bad_alloc();
  for (const Ball& ball : added) {
    point = std::copy_n(ball.centre.data(), 3, point);
    *point++ = ball.radius;
  }
  parts[attach(geometry, sets)] = {Part::Kind::kBalls, balls.size()};
  balls.insert(balls.end(), added.begin(), added.end());
}

void TraceScene::State::add_objects(const scene::Snapshot& snapshot,
                                    const std::vector<scene::ObjectSpec>& catalogue) {
  std::vector<Ball> opaque, acrylic;
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const scene::ObjectSpec& object = catalogue[snapshot.id[i]];
    const Finish& finish = finish_of(spec, object);
    const bool see_through = finish[3] == kSeeThrough;
    const Vec albedo = vec(linear_light({object.colour.r, object.colour.g, object.colour.b}));
    const Vec half = object.half_extents().cast<float>(), centre = vec(snapshot.position[i]);
    const auto& q = snapshot.orientation[i];
    const Eigen::Quaternionf orientation(q[3], q[0], q[1], q[2]);
    if (!centre.allFinite() || !orientation.coeffs().allFinite()) continue;
    if (object.shape == ShapeKind::kSphere) {
      (see_through ? acrylic : opaque).push_back({centre, albedo, half.x(), finish, orientation});
      continue;
    }
    if (object.shape == ShapeKind::kSolid && !object.solid) continue;
    const bool normalised = object.shape != ShapeKind::kSolid && object.shape != ShapeKind::kCapsule;
    const Vec scale = normalised ? half : Vec::Ones();
    const Mat turn = orientation.toRotationMatrix();
    place({.mesh = &shape_mesh(object),
           .axes = turn * scale.asDiagonal(),
           .normals = turn * scale.cwiseInverse().asDiagonal(),
           .centre = centre,
           .base = albedo,
           .accent = albedo,
           .finish = finish,
           .size = half.minCoeff()},
          see_through ? kAcrylic : kOpaque);
  }
  add_balls(opaque, kOpaque);
  add_balls(acrylic, kAcrylic);
}

void TraceScene::State::add_actuators() {
  const std::span<const InstancedMesh> meshes = actuators.meshes();
  actuator_meshes.resize(meshes.size());
  for (std::size_t k = 0; k < meshes.size(); ++k) {
    const InstancedMesh& mesh = meshes[k];
    if (mesh.instances.empty()) continue;
    MeshTree& kept = actuator_meshes[k];
    if (!kept.scene || mesh.deforms) {
      kept.vertices = mesh.mesh.vertices;
      kept.indices = mesh.mesh.indices;
      kept.stride = 7;
      tree(kept);
    }
    for (const MeshInstance& instance : mesh.instances) {
      Mat axes;
      axes << vec(instance.x), vec(instance.y), vec(instance.z);
      if (std::abs(axes.determinant()) < 1e-12F) continue;
      Mat normals;
      normals << axes.col(1).cross(axes.col(2)), axes.col(2).cross(axes.col(0)),
          axes.col(0).cross(axes.col(1));
      place({.mesh = &kept,
             .axes = axes,
             .normals = normals,
             .centre = vec(instance.centre),
             .base = rgb(instance.base_colour),
             .accent = rgb(instance.accent_colour),
             .base_opacity = static_cast<float>(instance.base_colour[3]) / 255.0F,
             .accent_opacity = static_cast<float>(instance.accent_colour[3]) / 255.0F,
             .finish = kActuatorFinish,
             .unlit = mesh.translucent},
            mesh.translucent ? kTranslucent : kOpaque);
    }
  }
}

void TraceScene::State::add_ground() {
  if (!spec.world.ground) return;
  const auto half = static_cast<float>(ground_half_edge(spec.surface)),
             z = static_cast<float>(spec.surface.ground_height());
  const Vec centre = surface_bounding_box(spec.surface).center().cast<float>();
  const float west = centre.x() - half, east = centre.x() + half, south = centre.y() - half,
              north = centre.y() + half;
  const float corners[] = {west, south, z, east, south, z, east, north, z, west, north, z};
  static constexpr std::uint32_t kTriangles[] = {0, 1, 2, 0, 2, 3};
  parts[attach(triangles(corners, 4, 3, kTriangles), kOpaque)] = {Part::Kind::kGround, 0};
}

// Each line is a rod as wide as the line at the distance of its ends.
void TraceScene::State::add_lines(const DrawOptions& options, const Camera& camera, float slope) {
  line_colours.clear();
  if (options.lines.empty()) return;
  RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
  auto* point = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), 2 * options.lines.size()));
  auto* first = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, sizeof(std::uint32_t), options.lines.size()));
  if (!point || !first) throw std::bad_alloc();
  for (const Line& line : options.lines) {
    *first++ = static_cast<std::uint32_t>(2 * line_colours.size());
    for (const auto& end : {line.from, line.to}) {
      point = std::copy_n(end.data(), 3, point);
      const double away = (vec(end).cast<double>() - camera.eye()).dot(camera.forward());
      *point++ = 0.5F * options.line_width * slope * static_cast<float>(std::max(away, 0.0));
    }
    line_colours.push_back(line.colour);
  }
  parts[attach(geometry, kLines)] = {Part::Kind::kLines, 0};
}

void TraceScene::State::read_pin(const RTCHit& hit, SurfacePoint& point) const {
  const std::size_t count = pin_mesh.triangles.size();
  const PinInstance& pin = pins[hit.primID / count];
  const auto& corners = pin_mesh.triangles[hit.primID % count];
  const Vec n = (1.0F - hit.u - hit.v) * pin_mesh.vertices[corners[0]].normal +
                hit.u * pin_mesh.vertices[corners[1]].normal + hit.v * pin_mesh.vertices[corners[2]].normal;
  const auto [cosine, sine] = pin.rotation;
  point.normal = {cosine * n.x() - sine * n.y(), sine * n.x() + cosine * n.y(), n.z()};
  point.albedo = rgb(pin.colour);
  if (point.position.z() < pin.height - static_cast<float>(spec.surface.pin.length))
    point.albedo *= kShaftAlbedo;
  point.finish = kPinFinish;
}

void TraceScene::State::read_ball(const Ball& ball, SurfacePoint& point) const {
  const Vec n = (point.position - ball.centre).normalized(), own = ball.orientation.conjugate() * n;
  point.position = ball.centre + ball.radius * n;
  point.normal = point.face = n;
  point.size = ball.radius;
  point.finish = ball.finish;
  point.albedo = ball.finish[3] == kGrain ? grain(ball.albedo, own, 1.0F) : ball.albedo;
  // A thin lighter band around the equator makes rolling visible.
  point.albedo +=
      (Vec::Ones() - point.albedo) * (kBandShare * (1.0F - smoothstep(0.04F, 0.07F, std::abs(own.z()))));
}

void TraceScene::State::read_placed(const Placed& placed, const RTCHit& hit, SurfacePoint& point) const {
  const MeshTree& mesh = *placed.mesh;
  const float weights[] = {1.0F - hit.u - hit.v, hit.u, hit.v};
  Vec normal = Vec::Zero();
  float accent = 0.0F;
  for (std::size_t k = 0; k < 3; ++k) {
    const float* const vertex = &mesh.vertices[mesh.stride * mesh.indices[3 * hit.primID + k]];
    normal += weights[k] * Vec(vertex[3], vertex[4], vertex[5]);
    if (mesh.stride > 6) accent += weights[k] * vertex[6];
  }
  point.normal = placed.normals * normal;
  point.face = placed.normals * Vec(hit.Ng_x, hit.Ng_y, hit.Ng_z);
  point.albedo = placed.base + accent * (placed.accent - placed.base);
  point.opacity = mix(placed.base_opacity, placed.accent_opacity, accent);
  point.finish = placed.finish;
  point.size = placed.size;
  point.unlit = placed.unlit;
  if (placed.finish[3] == kGrain) {
    // In the object's frame: the axes' lengths are scales.
    const Vec own = placed.axes.colwise().normalized().transpose() * (point.position - placed.centre);
    point.albedo = grain(point.albedo, {own.y(), own.z(), own.x()}, 1.2F * placed.size);
  }
}

void TraceScene::State::read_ground(SurfacePoint& point) const {
  point.albedo = floor_paint;
  point.finish = {1.0F, 0.0F, 0.0F, 0.0F};
  point.ground = true;
  if (grid == 0.0F) return;
  const float wide = pixel_slope * point.distance / grid_spacing;
  for (const float at : {point.position.x() / grid_spacing, point.position.y() / grid_spacing})
    if (std::abs(at - std::round(at)) < 0.5F * kGridLineWidth_px * wide)
      point.albedo = floor_paint * (1.0F - grid * 0.1F * (1.0F - smoothstep(0.08F, 0.35F, wide)));
}

TraceScene::TraceScene(const scene::SceneSpec& spec) : state_(std::make_unique<State>(spec)) {}
TraceScene::~TraceScene() = default;

void TraceScene::update(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                        const Camera& camera, const DrawOptions& options, const StageLight& stage,
                        float pixel_slope) {
  State& s = *state_;
  s.frame.reset(rtcNewScene(s.device.get()));
  s.parts.clear();
  s.placed_meshes.clear();
  s.balls.clear();
  s.pixel_slope = pixel_slope;
  s.floor_paint = vec(stage.floor_paint);
  s.grid = options.grid ? stage.grid : 0.0F;
  s.grid_spacing = static_cast<float>(grid_spacing(s.spec.surface));
  s.actuators.update(snapshot);
  const float cell_px = static_cast<float>(s.spec.surface.pitch / camera.distance()) / pixel_slope;
  s.add_pins(
      s.shading.update(snapshot, catalogue, options, false, false, s.actuators.recess(), near_walls(camera)),
      cell_px);
  s.close_outermost_gaps();
  s.add_actuators();
  scene::ObjectSpec box;
  box.shape = ShapeKind::kBox;
  for (const StaticBox& added : static_boxes(s.spec.surface, options.axes)) {
    const Vec half = (added.high - added.low).cast<float>() / 2.0F, colour = vec(linear_light(added.colour));
    s.place({.mesh = &s.shape_mesh(box),
             .axes = half.asDiagonal(),
             .normals = half.cwiseInverse().asDiagonal(),
             .centre = (added.low + added.high).cast<float>() / 2.0F,
             .base = colour,
             .accent = colour,
             .finish = kPlainFinish},
            kOpaque);
  }
  s.add_objects(snapshot, catalogue);
  s.add_ground();
  s.add_lines(options, camera, pixel_slope);
  rtcCommitScene(s.frame.get());
  if (rtcGetDeviceError(s.device.get()) != RTC_ERROR_NONE)
    throw std::runtime_error("Embree cannot build the picture's scene");
}

bool TraceScene::intersect(const Vec& origin, const Vec& direction, unsigned sets,
                           SurfacePoint& point) const {
  const State& s = *state_;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit found{};
  found.ray = ray_from(origin, direction, sets);
  found.hit.geomID = found.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(s.frame.get(), &context, &found);
  const RTCHit& hit = found.hit;
  if (hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  point.distance = found.ray.tfar;
  point.position = origin + found.ray.tfar * direction;
  point.normal = point.face = Vec(hit.Ng_x, hit.Ng_y, hit.Ng_z);
  const State::Part& part = s.parts[hit.instID[0] != RTC_INVALID_GEOMETRY_ID ? hit.instID[0] : hit.geomID];
  switch (part.kind) {
    case State::Part::Kind::kPins:
      s.read_pin(hit, point);
      break;
    case State::Part::Kind::kBalls:
      s.read_ball(s.balls[part.first + hit.primID], point);
      break;
    case State::Part::Kind::kPlaced:
      s.read_placed(s.placed_meshes[part.first], hit, point);
      break;
    case State::Part::Kind::kGround:
      s.read_ground(point);
      break;
    case State::Part::Kind::kLines: {
      const auto& c = s.line_colours[hit.primID];
      const float scale = 1.0F / 255.0F;
      point.albedo = vec(linear_light({c[0] * scale, c[1] * scale, c[2] * scale}));
      point.opacity = c[3] * scale;
      point.unlit = true;
      break;
    }
  }
  point.face.normalize();
  point.normal.normalize();
  if (point.face.dot(point.normal) < 0.0F) point.face = -point.face;
  point.inside = point.face.dot(direction) > 0.0F;
  if (point.inside) {
    point.face = -point.face;
    point.normal = -point.normal;
  }
  return true;
}

bool TraceScene::is_hidden(const Vec& origin, const Vec& direction, unsigned sets) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray = ray_from(origin, direction, sets);
  rtcOccluded1(state_->frame.get(), &context, &ray);
  return ray.tfar < 0.0F;
}

float TraceScene::offset() const { return 5e-4F * static_cast<float>(state_->spec.surface.pitch); }

}  // namespace smartsurf::view
