#include "smartsurf/web/GltfFile.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/files/AtomicFile.h"
#include "smartsurf/view/model/ActuatorGeometry.h"
#include "smartsurf/view/model/Meshes.h"
#include "smartsurf/view/model/Palette.h"
#include "smartsurf/view/model/PinShading.h"
#include "smartsurf/web/Frames.h"

namespace smartsurf::web {
namespace {

using nlohmann::json;
using record::Recording;

// Numbers of the glTF 2.0 specification.
constexpr int kFloat = 5126, kUint32 = 5125, kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr std::uint32_t kGlbMagic = 0x46546C67, kGlbVersion = 2, kJsonChunk = 0x4E4F534A,
                        kBinaryChunk = 0x004E4942;

constexpr int kSegments = 32;  // of round shapes
constexpr float kMoveTolerance = 0.001F, kPinTolerance = 0.002F, kTurnTolerance = 0.001F,
                kScaleTolerance = 0.002F;

// One animated property of a node: a value of N components for each frame.
template <std::size_t N>
struct Track {
  std::vector<std::array<float, N>> values;

  bool is_constant() const {
    return std::ranges::all_of(values, [&](const auto& v) { return v == values.front(); });
  }
};

// The frames that remain if the others are interpolated between them linearly, within the tolerance in each
// component: from each on, the farthest whose chord passes all frames between (the swinging door).
template <std::size_t N>
std::vector<std::size_t> key_frames(const Track<N>& track, std::span<const float> times_s, float tolerance) {
  const auto& v = track.values;
  std::vector<std::size_t> keys{0};
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  std::array<float, N> low, high;  // slopes from the last key frame that pass all frames since
  low.fill(-kInfinity), high.fill(kInfinity);
  for (std::size_t i = 1; i < v.size(); ++i) {
    const auto slope = [&](std::size_t c, float offset) {
      return (v[i][c] + offset - v[keys.back()][c]) / (times_s[i] - times_s[keys.back()]);
    };
    bool passes = true;
    for (std::size_t c = 0; c < N; ++c) passes = passes && slope(c, 0) >= low[c] && slope(c, 0) <= high[c];
    if (!passes) {
      keys.push_back(i - 1);
      low.fill(-kInfinity), high.fill(kInfinity);
    }
    for (std::size_t c = 0; c < N; ++c) {
      low[c] = std::max(low[c], slope(c, -tolerance));
      high[c] = std::min(high[c], slope(c, tolerance));
    }
  }
  if (v.size() > 1) keys.push_back(v.size() - 1);
  return keys;
}

class GltfFile {
 public:
  explicit GltfFile(std::vector<float> times_s) : times_s_(std::move(times_s)) {
    root_ = add_node({{"name", "table"}, {"rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}}, false);
  }

  std::span<const float> times_s() const { return times_s_; }

  // colour: linear light. The material is shared by all that have it.
  int material(const std::array<double, 4>& colour) {
    const auto [found, is_new] = material_of_.try_emplace(colour, static_cast<int>(materials_.size()));
    if (is_new) {
      materials_.push_back(
          {{"pbrMetallicRoughness",
            {{"baseColorFactor", colour}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.55}}}});
      if (colour[3] < 1) materials_.back()["alphaMode"] = "BLEND";
    }
    return found->second;
  }

  // positions, normals: 3 a vertex; colours: 4 a vertex, linear light, or empty.
  int add_mesh(const std::string& name, std::span<const float> positions, std::span<const float> normals,
               std::span<const float> colours, std::span<const std::uint32_t> indices, int material) {
    json attributes = {{"POSITION", add_accessor(positions, "VEC3", kArrayBuffer, true)},
                       {"NORMAL", add_accessor(normals, "VEC3", kArrayBuffer, false)}};
    if (!colours.empty()) attributes["COLOR_0"] = add_accessor(colours, "VEC4", kArrayBuffer, false);
    meshes_.push_back({{"name", name},
                       {"primitives",
                        {{{"attributes", std::move(attributes)},
                          {"indices", add_indices(indices)},
                          {"material", material}}}}});
    return static_cast<int>(meshes_.size()) - 1;
  }

  // A node of the table.
  int add_node(json node, bool in_table = true) {
    nodes_.push_back(std::move(node));
    const int index = static_cast<int>(nodes_.size()) - 1;
    if (in_table) nodes_[root_]["children"].push_back(index);
    return index;
  }
  json& node(int index) { return nodes_[index]; }

  // Sets the property of the node, and animates it if it changes. path: translation, rotation or scale.
  template <std::size_t N>
  void animate(int node_index, const char* path, const Track<N>& track, float tolerance, bool steps = false) {
    node(node_index)[path] = track.values.front();
    if (track.is_constant()) return;
    std::vector<float> times, values;
    for (const std::size_t key : key_frames(track, times_s_, steps ? 0.0F : tolerance)) {
      times.push_back(times_s_[key]);
      values.insert(values.end(), track.values[key].begin(), track.values[key].end());
    }
    const int input = add_accessor(times, "SCALAR", 0, true);
    const int output = add_accessor(values, N == 4 ? "VEC4" : "VEC3", 0, false);
    samplers_.push_back({{"input", input}, {"output", output}, {"interpolation", steps ? "STEP" : "LINEAR"}});
    channels_.push_back(
        {{"sampler", samplers_.size() - 1}, {"target", {{"node", node_index}, {"path", path}}}});
  }

  // The whole file. Throws scene::InputError if it is too large. frames: those of the recording at times_s().
  std::string bytes(const std::string& title, std::span<const std::size_t> frames,
                    const std::filesystem::path& path) const {
    json file = {{"asset", {{"version", "2.0"}, {"generator", "smartsurf " SMARTSURF_VERSION}}},
                 {"extras", {{"frames", frames}, {"times_s", times_s_}}},
                 {"scene", 0},
                 {"scenes", {{{"name", title}, {"nodes", {root_}}}}},
                 {"nodes", nodes_},
                 {"meshes", meshes_},
                 {"materials", materials_},
                 {"accessors", accessors_},
                 {"bufferViews", views_},
                 {"buffers", {{{"byteLength", binary_.size()}}}}};
    if (!channels_.empty())
      file["animations"] = {{{"name", "run"}, {"channels", channels_}, {"samplers", samplers_}}};
    std::string text = file.dump(-1, ' ', false, json::error_handler_t::replace);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const std::size_t size = 12 + 8 + text.size() + 8 + binary_.size();
    if (size > std::numeric_limits<std::uint32_t>::max())
      throw scene::InputError(path.string() +
                              ": would be larger than the 4 GiB of a .glb file; take fewer --fps");
    std::string all;
    all.reserve(size);
    const auto put = [&all](std::size_t number) {
      const auto word = static_cast<std::uint32_t>(number);
      all.append({static_cast<char>(word), static_cast<char>(word >> 8), static_cast<char>(word >> 16),
                  static_cast<char>(word >> 24)});
    };
    put(kGlbMagic), put(kGlbVersion), put(size);
    put(text.size()), put(kJsonChunk);
    all += text;
    put(binary_.size()), put(kBinaryChunk);
    all += binary_;
    return all;
  }

 private:
  template <class T>
  int add_view(std::span<const T> data, int target) {
    json view = {{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", data.size_bytes()}};
    if (target != 0) view["target"] = target;
    views_.push_back(std::move(view));
    binary_.append(reinterpret_cast<const char*>(data.data()), data.size_bytes());  // little-endian, as glTF
    return static_cast<int>(views_.size()) - 1;
  }
  int add_accessor(std::span<const float> data, const char* type, int target, bool with_bounds) {
    const std::size_t components = std::string_view(type) == "SCALAR" ? 1 : type[3] - '0';
    json accessor = {{"bufferView", add_view(data, target)},
                     {"componentType", kFloat},
                     {"count", data.size() / components},
                     {"type", type}};
    if (with_bounds) {
      std::vector<float> low(data.begin(), data.begin() + components), high = low;
      for (std::size_t i = 0; i < data.size(); ++i) {
        low[i % components] = std::min(low[i % components], data[i]);
        high[i % components] = std::max(high[i % components], data[i]);
      }
      accessor["min"] = low, accessor["max"] = high;
    }
    accessors_.push_back(std::move(accessor));
    return static_cast<int>(accessors_.size()) - 1;
  }
  int add_indices(std::span<const std::uint32_t> indices) {
    accessors_.push_back({{"bufferView", add_view(indices, kElementArrayBuffer)},
                          {"componentType", kUint32},
                          {"count", indices.size()},
                          {"type", "SCALAR"}});
    return static_cast<int>(accessors_.size()) - 1;
  }

  std::vector<float> times_s_;
  int root_ = 0;
  std::vector<json> nodes_, meshes_, materials_, accessors_, views_, samplers_, channels_;
  std::map<std::array<double, 4>, int> material_of_;
  std::string binary_;
};

std::array<double, 4> linear_colour(const view::Rgb& colour) {
  const view::Rgb linear = view::linear_light(colour);
  return {linear[0], linear[1], linear[2], 1.0};
}

// ---- objects

// A mesh with the object's size. Vertices of a capsule are moved apart by its straight part.
int add_object_mesh(GltfFile& file, const scene::ObjectSpec& object) {
  using scene::ShapeKind;
  const view::Mesh mesh = object.shape == ShapeKind::kBox        ? view::box_mesh()
                          : object.shape == ShapeKind::kCylinder ? view::cylinder_mesh(kSegments)
                          : object.shape == ShapeKind::kCone     ? view::cone_mesh(kSegments)
                          : object.shape == ShapeKind::kSolid    ? view::solid_mesh(*object.solid)
                                                                 : view::capsule_mesh(kSegments);
  const bool is_round = object.shape == ShapeKind::kSphere || object.shape == ShapeKind::kCapsule;
  const Eigen::Vector3f half = object.half_extents().cast<float>();
  std::vector<float> positions, normals;
  for (std::size_t i = 0; i + 5 < mesh.vertices.size(); i += 6) {
    const Eigen::Map<const Eigen::Vector3f> at(&mesh.vertices[i]), normal(&mesh.vertices[i + 3]);
    Eigen::Vector3f p = at, n = normal;
    if (is_round) {
      p = half.x() * at + Eigen::Vector3f(0, 0, std::copysign(half.z() - half.x(), at.z()));
    } else if (object.shape != ShapeKind::kSolid) {
      p = half.cwiseProduct(at);
      n = normal.cwiseQuotient(half).normalized();
    }
    positions.insert(positions.end(), {p.x(), p.y(), p.z()});
    normals.insert(normals.end(), {n.x(), n.y(), n.z()});
  }
  static constexpr const char* kNames[] = {"sphere", "box", "cylinder", "capsule", "cone", "solid"};
  return file.add_mesh(kNames[static_cast<int>(object.shape)], positions, normals, {}, mesh.indices,
                       file.material(linear_colour({object.colour.r, object.colour.g, object.colour.b})));
}

// Poses of one object in all frames; where it does not exist, that of the last frame in which it did.
struct ObjectTracks {
  Track<3> position, scale;
  Track<4> orientation;

  void add(const std::array<float, 3>& p, std::array<float, 4> q, bool exists) {
    // q and −q are the same rotation: the nearer one, so that no interpolation goes the long way.
    if (!orientation.values.empty()) {
      const auto& last = orientation.values.back();
      if (q[0] * last[0] + q[1] * last[1] + q[2] * last[2] + q[3] * last[3] < 0)
        for (float& component : q) component = -component;
    }
    position.values.push_back(p);
    orientation.values.push_back(q);
    const float size = exists ? 1.0F : 0.0F;
    scale.values.push_back({size, size, size});
  }
};

bool is_pose(const std::array<float, 3>& p) {
  return std::ranges::all_of(p, [](float c) { return std::isfinite(c); });
}

void add_objects(GltfFile& file, const Recording& recording, const std::vector<std::size_t>& frames) {
  const std::vector<scene::ObjectSpec>& specs = recording.spec().objects;
  std::vector<ObjectTracks> tracks(specs.size());
  for (const std::size_t frame : frames) {
    const scene::Snapshot snapshot = recording.read_snapshot(frame);
    std::vector<bool> exists(specs.size());
    for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
      if (!is_pose(snapshot.position[i])) continue;
      exists[snapshot.id[i]] = true;
      tracks[snapshot.id[i]].add(snapshot.position[i], snapshot.orientation[i], true);
    }
    for (std::size_t id = 0; id < specs.size(); ++id) {
      if (exists[id]) continue;
      const ObjectTracks& t = tracks[id];
      if (t.position.values.empty())
        tracks[id].add({0, 0, 0}, {0, 0, 0, 1}, false);
      else
        tracks[id].add(t.position.values.back(), t.orientation.values.back(), false);
    }
  }
  for (std::size_t id = 0; id < specs.size(); ++id) {
    const std::string& label = specs[id].label;
    const int node = file.add_node({{"name", (label.empty() ? "object" : label) + " " + std::to_string(id)},
                                    {"mesh", add_object_mesh(file, specs[id])}});
    file.animate(node, "translation", tracks[id].position, kMoveTolerance);
    file.animate(node, "rotation", tracks[id].orientation, kTurnTolerance);
    file.animate(node, "scale", tracks[id].scale, 0, true);
  }
}

// ---- the table

// A box with the pin's edges, its top at z = 0.
int add_pin_mesh(GltfFile& file, const scene::SurfaceSpec& s, const char* name, double length,
                 const view::Rgb& colour) {
  const view::Mesh mesh = view::box_mesh();
  std::vector<float> positions, normals;
  const auto [half_x, half_y] = view::prism_half_edges(s);
  const Eigen::Vector3f half(half_x, half_y, static_cast<float>(length / 2));
  std::vector<std::uint32_t> indices;
  for (int turn = 0; turn < view::prisms_per_cell(s); ++turn) {
    const Eigen::AngleAxisf rotation(static_cast<float>(turn) * std::numbers::pi_v<float> / 3.0F,
                                     Eigen::Vector3f::UnitZ());
    const auto first = static_cast<std::uint32_t>(positions.size() / 3);
    for (const auto index : mesh.indices) indices.push_back(first + index);
    for (std::size_t i = 0; i + 5 < mesh.vertices.size(); i += 6) {
      const Eigen::Map<const Eigen::Vector3f> place(&mesh.vertices[i]), normal(&mesh.vertices[i + 3]);
      const Eigen::Vector3f at = rotation * half.cwiseProduct(place - Eigen::Vector3f::UnitZ()),
                            facing = rotation * normal;
      positions.insert(positions.end(), at.begin(), at.end());
      normals.insert(normals.end(), facing.begin(), facing.end());
    }
  }
  return file.add_mesh(name, positions, normals, {}, indices, file.material(linear_colour(colour)));
}

// recess: of the same frame, because it follows the mechanism and the skin.
std::vector<float> drawn_tops(std::span<const float> heights, std::span<const float> recess) {
  std::vector<float> tops(heights.size());
  for (std::size_t cell = 0; cell < tops.size(); ++cell)
    tops[cell] =
        (std::isfinite(heights[cell]) ? heights[cell] : 0.0F) - (recess.empty() ? 0.0F : recess[cell]);
  return tops;
}

// tops: z of the pins as they are drawn, of each frame, row-major.
void add_pins(GltfFile& file, const scene::SurfaceSpec& s, const std::vector<std::vector<float>>& tops) {
  const int pin = add_pin_mesh(file, s, "pin", s.pin.length, view::kHighestPinColour);
  // The border stands on the level of the lowest pin's foot.
  const int wall = s.border_height
                       ? add_pin_mesh(file, s, "wall", *s.border_height - s.pin.min_height + s.pin.length,
                                      view::kBorderColour)
                       : pin;
  for (int row = 0; row < s.rows; ++row)
    for (int column = 0; column < s.columns; ++column) {
      const std::size_t cell = s.index(row, column);
      if (s.is_empty(row, column)) continue;
      const Eigen::Vector2f at = s.centre(row, column).cast<float>();
      Track<3> track;
      for (const std::vector<float>& frame : tops) track.values.push_back({at.x(), at.y(), frame[cell]});
      const int node = file.add_node({{"name", "pin " + std::to_string(row) + "," + std::to_string(column)},
                                      {"mesh", s.is_border(row, column) ? wall : pin}});
      if (!s.cell_poses.empty()) {
        const double angle = s.cell_poses[cell].angle;
        file.node(node)["rotation"] = {0, 0, std::sin(angle / 2), std::cos(angle / 2)};
      }
      file.animate(node, "translation", track, kPinTolerance);
    }
}

// ---- parts of actuators

int add_part_mesh(GltfFile& file, const view::InstancedMesh& part, const view::MeshInstance& instance) {
  std::vector<float> positions, normals, colours;
  for (std::size_t i = 0; i + 6 < part.mesh.vertices.size(); i += 7) {
    const float* v = &part.mesh.vertices[i];
    positions.insert(positions.end(), {v[0], v[1], v[2]});
    normals.insert(normals.end(), {v[3], v[4], v[5]});
    for (std::size_t c = 0; c < 4; ++c)
      colours.push_back((static_cast<float>(instance.base_colour[c]) * (1 - v[6]) +
                         static_cast<float>(instance.accent_colour[c]) * v[6]) /
                        255.0F);
  }
  const double opacity = part.translucent ? 0.5 : 1.0;
  return file.add_mesh("part", positions, normals, colours, part.mesh.indices,
                       file.material({1.0, 1.0, 1.0, opacity}));
}

// The axes of an instance as a rotation and the lengths of the axes, the first one mirrored where they are
// left-handed. A node cannot be sheared as a leaning plume is: its z axis is kept. A part without a size
// keeps its last rotation.
void add_pose(const view::MeshInstance* instance, ObjectTracks& tracks) {
  if (!instance) {
    tracks.add(tracks.position.values.back(), tracks.orientation.values.back(), false);
    return;
  }
  Eigen::Matrix3f axes;
  axes << Eigen::Map<const Eigen::Vector3f>(instance->x.data()),
      Eigen::Map<const Eigen::Vector3f>(instance->y.data()),
      Eigen::Map<const Eigen::Vector3f>(instance->z.data());
  Eigen::Vector3f lengths = axes.colwise().norm().transpose();
  const bool is_flat = lengths.minCoeff() < 1e-6F;
  if (axes.determinant() < 0) lengths.x() = -lengths.x();
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();
  if (!is_flat) {
    const Eigen::Vector3f z = axes.col(2) / lengths.z(), x = axes.col(0) / lengths.x();
    rotation.col(0) = (x - x.dot(z) * z).normalized();
    rotation.col(1) = z.cross(rotation.col(0));
    rotation.col(2) = z;
  }
  const Eigen::Quaternionf q(rotation);
  const bool is_kept = is_flat && !tracks.orientation.values.empty();
  tracks.add(instance->centre,
             is_kept ? tracks.orientation.values.back() : std::array<float, 4>{q.x(), q.y(), q.z(), q.w()},
             true);
  tracks.scale.values.back() = {lengths.x(), lengths.y(), lengths.z()};
}

void add_table(GltfFile& file, const Recording& recording, const std::vector<std::size_t>& frames) {
  const scene::SurfaceSpec& s = recording.spec().surface;
  view::ActuatorGeometry geometry(s);
  geometry.keep_hidden_parts();
  std::vector<std::vector<float>> tops;
  std::vector<std::vector<ObjectTracks>> tracks;  // of each mesh, each instance
  std::vector<std::vector<int>> meshes;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const scene::Snapshot snapshot = recording.read_snapshot(frames[f]);
    geometry.update(snapshot);
    tops.push_back(drawn_tops(snapshot.height, geometry.recess()));
    if (f == 0) {
      tracks.resize(geometry.meshes().size()), meshes.resize(geometry.meshes().size());
      for (std::size_t m = 0; m < geometry.meshes().size(); ++m) {
        const view::InstancedMesh& part = geometry.meshes()[m];
        tracks[m].resize(part.instances.size());
        std::map<std::array<std::array<std::uint8_t, 4>, 2>, int> mesh_of;  // by colours
        for (const view::MeshInstance& instance : part.instances) {
          const auto [found, is_new] = mesh_of.try_emplace({instance.base_colour, instance.accent_colour}, 0);
          if (is_new) found->second = add_part_mesh(file, part, instance);
          meshes[m].push_back(found->second);
        }
      }
    }
    for (std::size_t m = 0; m < tracks.size(); ++m)
      for (std::size_t i = 0; i < tracks[m].size(); ++i) {
        const auto& instances = geometry.meshes()[m].instances;
        add_pose(i < instances.size() ? &instances[i] : nullptr, tracks[m][i]);
      }
  }
  if (recording.has_heights()) add_pins(file, s, tops);
  for (std::size_t m = 0; m < tracks.size(); ++m)
    for (std::size_t i = 0; i < tracks[m].size(); ++i) {
      const int node = file.add_node(
          {{"name", "part " + std::to_string(m) + "," + std::to_string(i)}, {"mesh", meshes[m][i]}});
      file.animate(node, "translation", tracks[m][i].position, kMoveTolerance);
      file.animate(node, "rotation", tracks[m][i].orientation, kTurnTolerance);
      file.animate(node, "scale", tracks[m][i].scale, kScaleTolerance);
    }
}

}  // namespace

void write_gltf(const Recording& recording, const std::filesystem::path& path, const GltfOptions& options) {
  const std::vector<std::size_t> frames = select_frames(recording, options.frames_per_second);
  std::vector<float> times_s;
  for (const std::size_t frame : frames)
    times_s.push_back(static_cast<float>(recording.times()[frame] - recording.times()[frames.front()]));
  GltfFile file(std::move(times_s));
  if (recording.has_objects()) add_objects(file, recording, frames);
  add_table(file, recording, frames);
  const std::string title = std::filesystem::path(recording.spec().file).filename().string();
  if (const std::error_code error = common::replace_file(path, file.bytes(title, frames, path)))
    throw scene::InputError(path.string() + ": cannot be written: " + error.message());
}

}  // namespace smartsurf::web
