#include "smartsurf/view/model/ActuatorGeometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "smartsurf/scene/Delta.h"
#include "smartsurf/scene/PinTip.h"
#include "smartsurf/view/model/ActuatorMeshes.h"
#include "smartsurf/view/model/Float3.h"
#include "smartsurf/view/model/Palette.h"

namespace smartsurf::view {
namespace {

using Vec = Eigen::Vector3f;
using Mat = Eigen::Matrix3f;

constexpr float kQuarterTurn = 1.5707963F;

// Weaker forces and flows are not drawn.
constexpr NamedNumber kMinVisibleLevel{"min_visible_level", 0.02F};
// How far parts are sunk into their pins, in radii.
constexpr NamedNumber kBallRecess{"ball_recess", 0.75F}, kWheelRecess{"wheel_recess", 0.9F};
// The distance of a wheel's middle from the cell's, in edges of the top: across and along its axle.
constexpr NamedNumber kWheelAcross{"wheel_across", 0.15F}, kWheelAlong{"wheel_along", 0.22F};
constexpr NamedNumber kMaxRotorRadius{"max_rotor_radius", 0.55F};  // pitches
// Half extents of an arrow, in pitches, and what a strength of 1 adds. Always longer than wide, so that the
// direction stays visible.
constexpr NamedNumber kArrowLength{"arrow_length", 0.16F}, kArrowLengthGain{"arrow_length_gain", 0.30F};
constexpr NamedNumber kArrowWidth{"arrow_width", 0.09F}, kArrowWidthGain{"arrow_width_gain", 0.07F};
// The height of a plume's foot, in edges of the top; its length, in that at full flow, and its opacity, with
// what full flow adds.
constexpr NamedNumber kPlumeFoot{"plume_foot", 0.1F};
constexpr NamedNumber kPlumeLength{"plume_length", 0.2F}, kPlumeLengthGain{"plume_length_gain", 0.8F};
constexpr NamedNumber kPlumeOpacity{"plume_opacity", 0.15F}, kPlumeOpacityGain{"plume_opacity_gain", 0.4F};
constexpr NamedNumber kMaxPlateSlope{"max_plate_slope", 0.7F};
constexpr NamedNumber kSkinClearance{"skin_clearance", 0.02F};  // above the tops, pitches
constexpr NamedNumber kLooks[] = {
    kMinVisibleLevel, kBallRecess,      kWheelRecess,      kWheelAcross,    kWheelAlong,   kMaxRotorRadius,
    kArrowLength,     kArrowLengthGain, kArrowWidth,       kArrowWidthGain, kPlumeFoot,    kPlumeLength,
    kPlumeLengthGain, kPlumeOpacity,    kPlumeOpacityGain, kMaxPlateSlope,  kSkinClearance};

std::array<std::uint8_t, 4> to_linear_rgba8(const Rgb& srgb, float alpha) {
  const Rgb light = linear_light(srgb);
  return {to_byte(light[0]), to_byte(light[1]), to_byte(light[2]), to_byte(alpha)};
}

Rgb mix_colours(const Rgb& a, const Rgb& b, float t) {
  Rgb c;
  for (std::size_t i = 0; i < 3; ++i) c[i] = a[i] + (b[i] - a[i]) * t;
  return c;
}

constexpr Rgb kIvory{0.93F, 0.91F, 0.86F}, kInk{0.16F, 0.20F, 0.27F}, kOrange{0.95F, 0.55F, 0.10F};
constexpr Rgb kTyre{0.20F, 0.21F, 0.23F}, kCopper{0.62F, 0.42F, 0.26F}, kIron{0.78F, 0.79F, 0.80F};
constexpr Rgb kRed{0.86F, 0.10F, 0.12F}, kBlue{0.10F, 0.28F, 0.88F}, kAir{0.45F, 0.78F, 0.95F};
constexpr Rgb kWeakForce{0.98F, 0.80F, 0.45F}, kStrongForce{0.85F, 0.22F, 0.05F};
constexpr Rgb kRubber{0.70F, 0.72F, 0.74F}, kIdle{0.42F, 0.46F, 0.52F}, kVibrating{0.98F, 0.72F, 0.12F};
constexpr Rgb kSkin{0.52F, 0.60F, 0.66F};
constexpr NamedColour kColours[] = {{"ivory", kIvory},
                                    {"ink", kInk},
                                    {"orange", kOrange},
                                    {"tyre", kTyre},
                                    {"copper", kCopper},
                                    {"iron", kIron},
                                    {"red", kRed},
                                    {"blue", kBlue},
                                    {"air", kAir},
                                    {"weak_force", kWeakForce},
                                    {"strong_force", kStrongForce},
                                    {"rubber", kRubber},
                                    {"idle", kIdle},
                                    {"vibrating", kVibrating},
                                    {"skin", kSkin}};

// The two angles are applied about x, then about y.
Mat roll_pitch(const scene::ActuatorState& motion) {
  return (Eigen::AngleAxisf(motion.b, Vec::UnitY()) * Eigen::AngleAxisf(motion.a, Vec::UnitX()))
      .toRotationMatrix();
}

Vec to_vector(const std::vector<double>& v, std::size_t first = 0) {
  return Eigen::Vector3d(v[first], v[first + 1], v[first + 2]).cast<float>();
}

float float_parameter(const scene::ActuatorSpec& spec, const char* name) {
  return static_cast<float>(spec.number(name));
}

int segments_for(int cells) { return cells <= 400 ? 24 : cells <= 1600 ? 16 : 12; }

// The shape of a rotor: an ellipsoid if `points` is empty, else the convex hull of `points`.
struct RotorShape {
  Vec axis, half_axes;
  std::vector<Vec> points;
  float max_height(const Mat& rotation) const {
    if (points.empty()) return half_axes.cwiseProduct(Vec(rotation.row(2).transpose())).norm();
    float highest = -1e30F;
    for (const Vec& p : points) highest = std::max(highest, rotation.row(2).dot(p.transpose()));
    return highest;
  }
  float max_radius() const {
    float farthest = points.empty() ? half_axes.maxCoeff() : 0.0F;
    for (const Vec& p : points) farthest = std::max(farthest, p.norm());
    return farthest;
  }
};

RotorShape make_rotor_shape(const scene::ActuatorSpec& spec) {
  RotorShape t{to_vector(spec.numbers("axis")).normalized(), to_vector(spec.numbers("half_axes")), {}};
  if (spec.has("points"))
    for (std::size_t i = 0; i + 2 < spec.numbers("points").size(); i += 3)
      t.points.push_back(to_vector(spec.numbers("points"), i));
  return t;
}

// Above this limit a sphere around the points is drawn: hull_mesh() tests all triples of points.
constexpr std::size_t kMaxHullPoints = 32;

}  // namespace

std::span<const NamedColour> actuator_colours() { return kColours; }
std::span<const NamedNumber> actuator_looks() { return kLooks; }

// The pose of a cell: the centre of its top and its axes.
struct ActuatorGeometry::CellFrame {
  Vec top;
  Mat axes;
};

ActuatorGeometry::CellFrame ActuatorGeometry::cell_frame(std::size_t cell,
                                                         const scene::Snapshot& snapshot) const {
  const int row = static_cast<int>(cell) / surface_.columns,
            column = static_cast<int>(cell) % surface_.columns;
  const Eigen::Vector2f at = surface_.centre(row, column).cast<float>();
  const float angle =
      surface_.cell_poses.empty() ? 0.0F : static_cast<float>(surface_.cell_poses[cell].angle);
  const float top = snapshot.height[cell] - (drop_.empty() ? 0.0F : drop_[cell]);
  return {{at.x(), at.y(), top}, Eigen::AngleAxisf(angle, Vec::UnitZ()).toRotationMatrix()};
}

ActuatorGeometry::ActuatorGeometry(const scene::SurfaceSpec& surface)
    : surface_(surface),
      top_edge_(static_cast<float>(std::min(surface.pin.top_x, surface.pin.top_y))),
      segments_(segments_for(surface.cell_count())) {
  const std::vector<scene::ActuatorSpec> actuators = surface.effective_actuators();
  for (std::size_t m = 0; m < actuators.size(); ++m) {
    first_mesh_.push_back(meshes_.size());
    const InstanceBuilder builder = make_builder(actuators[m]);
    if (!builder) continue;
    builders_.push_back(builder);
    for (int row = 0; row < surface.rows; ++row)
      for (int column = 0; column < surface.columns; ++column) {
        const int cell = surface.index(row, column);
        const std::size_t actuator = surface.actuator_of_cell.empty() ? 0 : surface.actuator_of_cell[cell];
        if (actuator != m || surface.is_empty(row, column)) continue;
        if (surface.border_height && surface.is_border(row, column)) continue;
        cells_.push_back(cell);
        builder_of_cell_.push_back(builders_.size() - 1);
      }
  }
  first_mesh_.push_back(meshes_.size());
  if (!cells_.empty() || surface.skin) recess_.assign(surface.cell_count(), 0.0F);
  if (surface.skin) add_skin();
}

// The last mesh. Its axes are the world's.
void ActuatorGeometry::add_skin() {
  const scene::SkinSpec& skin = *surface_.skin;
  const int border = surface_.border_height ? 1 : 0;
  const auto pitch = static_cast<float>(surface_.pitch);
  const Eigen::AlignedBox2f extent = surface_.skin_extent().cast<float>();
  const Eigen::Vector2f low = extent.min(), high = extent.max();
  const auto along = [](float from, float to, int i, int count) {
    return from + (to - from) * static_cast<float>(i) / static_cast<float>(count - 1);
  };
  const auto is_over_top = [&](float x, float y) {
    const float column = std::round(x / pitch),
                row = static_cast<float>(surface_.rows - 1) - std::round(y / pitch);
    const int last_row = surface_.rows - 1 - border, last_column = surface_.columns - 1 - border;
    const int r = std::clamp(static_cast<int>(row), border, last_row),
              c = std::clamp(static_cast<int>(column), border, last_column);
    const Eigen::Vector2f from = Eigen::Vector2f(x, y) - surface_.centre(r, c).cast<float>();
    return !surface_.is_empty(r, c) && std::abs(from.x()) <= 0.5F * static_cast<float>(surface_.pin.top_x) &&
           std::abs(from.y()) <= 0.5F * static_cast<float>(surface_.pin.top_y);
  };
  TwoColourMesh mesh;
  for (int r = 0; r < skin.rows; ++r)
    for (int c = 0; c < skin.columns; ++c) {
      const float x = along(low.x(), high.x(), c, skin.columns), y = along(high.y(), low.y(), r, skin.rows);
      mesh.vertices.insert(mesh.vertices.end(),
                           {x, y, 0.0F, 0.0F, 0.0F, 1.0F, is_over_top(x, y) ? 1.0F : 0.0F});
      if (r + 1 == skin.rows || c + 1 == skin.columns) continue;
      const auto north_west = static_cast<std::uint32_t>(r * skin.columns + c),
                 south_west = north_west + static_cast<std::uint32_t>(skin.columns);
      mesh.indices.insert(mesh.indices.end(), {north_west, south_west + 1, north_west + 1});
      mesh.indices.insert(mesh.indices.end(), {north_west, south_west, south_west + 1});
    }
  InstancedMesh& added = meshes_[add_mesh(std::move(mesh))];
  added.deforms = true;

  // The nodes over a top and the next ones outside it.
  const auto range_over = [](float from, float to, int count, float centre, double top) {
    const float step = (to - from) / static_cast<float>(count - 1), half = 0.5F * static_cast<float>(top);
    const float a = (centre - half - from) / step, b = (centre + half - from) / step;
    return NodeRange{std::clamp(static_cast<int>(std::floor(std::min(a, b))), 0, count - 1),
                     std::clamp(static_cast<int>(std::ceil(std::max(a, b))), 0, count - 1)};
  };
  for (int row = 0; row < surface_.rows; ++row)
    node_rows_.push_back(range_over(high.y(), low.y(), skin.rows,
                                    static_cast<float>(surface_.rows - 1 - row) * pitch, surface_.pin.top_y));
  for (int column = 0; column < surface_.columns; ++column)
    node_columns_.push_back(
        range_over(low.x(), high.x(), skin.columns, static_cast<float>(column) * pitch, surface_.pin.top_x));
  drop_.assign(recess_.size(), 0.0F);
}

// Lowers the drawn tops slightly, so that they do not show through the skin where it bends off their edges.
void ActuatorGeometry::update_drops(const scene::Snapshot& snapshot) {
  const scene::SkinSpec& skin = *surface_.skin;
  if (std::ssize(snapshot.skin_height) != skin.rows * skin.columns) return;
  const float clearance = kSkinClearance.value * static_cast<float>(surface_.pitch);
  for (int row = 0; row < surface_.rows; ++row)
    for (int column = 0; column < surface_.columns; ++column) {
      const int cell = surface_.index(row, column);
      if (!surface_.is_under_skin(row, column) || surface_.is_empty(row, column)) continue;
      const NodeRange rows = node_rows_[row], columns = node_columns_[column];
      float lowest = snapshot.height[cell];
      for (int r = rows.first; r <= rows.last; ++r)
        for (int c = columns.first; c <= columns.last; ++c)
          lowest = std::min(lowest, snapshot.skin_height[r * skin.columns + c]);
      drop_[cell] = snapshot.height[cell] - lowest + clearance;
    }
}

// Normals are those of a smooth surface through the nodes.
void ActuatorGeometry::update_skin(const scene::Snapshot& snapshot) {
  const scene::SkinSpec& skin = *surface_.skin;
  InstancedMesh& added = meshes_.back();
  std::vector<float>& vertices = added.mesh.vertices;
  if (snapshot.skin_height.size() * 7 != vertices.size()) return;
  draw(meshes_.size() - 1, Vec::Zero(), Mat::Identity(), kSkin, kRubber);
  const auto vertex = [&](int r, int c) {
    return 7 * (std::clamp(r, 0, skin.rows - 1) * skin.columns + std::clamp(c, 0, skin.columns - 1));
  };
  for (std::size_t i = 0; i < snapshot.skin_height.size(); ++i) vertices[7 * i + 2] = snapshot.skin_height[i];
  const auto slope = [&vertices](std::size_t from, std::size_t to, std::size_t axis) {
    return (vertices[to + 2] - vertices[from + 2]) / (vertices[to + axis] - vertices[from + axis]);
  };
  for (int r = 0; r < skin.rows; ++r)
    for (int c = 0; c < skin.columns; ++c) {
      const Vec normal = Vec(-slope(vertex(r, c - 1), vertex(r, c + 1), 0),
                             -slope(vertex(r + 1, c), vertex(r - 1, c), 1), 1.0F)
                             .normalized();
      std::copy_n(normal.data(), 3, vertices.begin() + (vertex(r, c) + 3));
    }
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::make_builder(const scene::ActuatorSpec& spec) {
  if (spec.model == "ball") return ball_builder(spec);
  if (spec.model == "wheels") return wheel_builder(spec);
  if (spec.model == "rotor") return rotor_builder(spec);
  if (spec.model == "force_field" || spec.model == "conveyor") return arrow_builder();
  if (spec.model == "magnet") return coil_builder();
  if (spec.model == "air_jet") return jet_builder(spec);
  if (spec.model == "tile")
    return spec.number("command") == 0.0 ? vibrating_plate_builder() : tilting_plate_builder(spec);
  if (spec.model == "delta") return delta_builder(spec);
  if (spec.model == "pin" && spec.number("tip.shape") != 0.0) return tip_builder(spec);
  return {};
}

std::size_t ActuatorGeometry::add_mesh(TwoColourMesh mesh, const Vec& size, bool translucent) {
  meshes_.push_back({std::move(mesh), size, translucent, false, {}});
  return meshes_.size() - 1;
}

void ActuatorGeometry::draw(std::size_t mesh, const Vec& at, const Mat& axes, const Rgb& base,
                            const Rgb& accent, float base_alpha, float accent_alpha) {
  meshes_[mesh].instances.push_back({to_float3(axes.col(0)), to_float3(axes.col(1)), to_float3(axes.col(2)),
                                     to_float3(at), to_linear_rgba8(base, base_alpha),
                                     to_linear_rgba8(accent, accent_alpha)});
}

void ActuatorGeometry::update(const scene::Snapshot& snapshot) {
  for (InstancedMesh& mesh : meshes_) mesh.instances.clear();
  std::ranges::fill(recess_, 0.0F);
  if (surface_.skin) update_drops(snapshot);
  const scene::ActuatorState rest;
  for (std::size_t k = 0; k < cells_.size(); ++k) {
    const std::size_t cell = cells_[k];
    if (!std::isfinite(snapshot.height[cell])) continue;
    builders_[builder_of_cell_[k]](cell, snapshot,
                                   snapshot.actuator_state.empty() ? rest : snapshot.actuator_state[cell]);
  }
  for (std::size_t cell = 0; cell < drop_.size(); ++cell) recess_[cell] += drop_[cell];
  if (surface_.skin) update_skin(snapshot);
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::ball_builder(const scene::ActuatorSpec& spec) {
  const float radius = std::min(float_parameter(spec, "radius"), 0.5F * top_edge_);
  const std::size_t mesh = add_mesh(ball_mesh(segments_), Vec::Constant(radius));
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = cell_frame(cell, snapshot);
    draw(mesh, f.top - radius * Vec::UnitZ(), radius * (f.axes * roll_pitch(motion)), kIvory, kOrange);
    recess_[cell] = kBallRecess.value * radius;
  };
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::wheel_builder(const scene::ActuatorSpec& spec) {
  const float radius = std::min(float_parameter(spec, "radius"), 0.3F * top_edge_),
              half_width = 0.11F * top_edge_;
  const Mat set = Eigen::AngleAxisf(float_parameter(spec, "angle"), Vec::UnitZ()).toRotationMatrix();
  const Mat left = Eigen::AngleAxisf(kQuarterTurn, Vec::UnitZ()).toRotationMatrix();
  const Vec size(radius, half_width, radius);
  const std::size_t mesh = add_mesh(wheel_mesh(segments_), size);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = cell_frame(cell, snapshot);
    const Mat mount = f.axes * set;
    const auto add = [&](const Mat& heading, const Vec& offset, float angle) {
      const Mat turn = Eigen::AngleAxisf(angle, Vec::UnitY()).toRotationMatrix();
      draw(mesh, f.top + mount * (top_edge_ * offset) - radius * Vec::UnitZ(),
           mount * heading * turn * size.asDiagonal(), kTyre, kOrange);
    };
    add(Mat::Identity(), {-kWheelAcross.value, kWheelAlong.value, 0}, motion.a);
    add(left, {kWheelAlong.value, -kWheelAcross.value, 0}, motion.b);
    recess_[cell] = kWheelRecess.value * radius;
  };
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::rotor_builder(const scene::ActuatorSpec& spec) {
  const RotorShape shape = make_rotor_shape(spec);
  const bool corners = !shape.points.empty() && shape.points.size() <= kMaxHullPoints;
  const float scale =
      std::min(1.0F, kMaxRotorRadius.value * static_cast<float>(surface_.pitch) / shape.max_radius());
  const Vec half = shape.points.empty() ? shape.half_axes : Vec::Constant(shape.max_radius());
  const Vec size = corners ? Vec(Vec::Constant(scale)) : Vec(scale * half);
  const std::size_t mesh = add_mesh(corners ? hull_mesh(shape.points) : ball_mesh(segments_), size);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = cell_frame(cell, snapshot);
    const Mat turn = Eigen::AngleAxisf(motion.a, shape.axis).toRotationMatrix();
    const float highest = shape.max_height(turn);
    draw(mesh, f.top - scale * highest * Vec::UnitZ(), f.axes * turn * size.asDiagonal(), kIvory, kOrange);
    recess_[cell] = highest;
  };
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::arrow_builder() {
  const std::size_t mesh = add_mesh(arrow_mesh());
  const auto pitch = static_cast<float>(surface_.pitch);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const Vec force(motion.a, motion.b, motion.level);
    const float strength = std::min(1.0F, force.norm());
    const Vec top = cell_frame(cell, snapshot).top;
    if (!(strength > kMinVisibleLevel.value)) {
      if (keeps_hidden_parts_) draw(mesh, top, Mat::Zero(), kStrongForce, kStrongForce);
      return;
    }
    const float half_length = pitch * (kArrowLength.value + kArrowLengthGain.value * strength),
                half_width = pitch * (kArrowWidth.value + kArrowWidthGain.value * strength);
    const Vec along = force.normalized();
    const Vec aside =
        (std::abs(along.z()) < 0.95F ? Vec::UnitZ().cross(along) : Vec::UnitX().cross(along)).normalized();
    Mat axes;
    axes << half_length * along, half_width * aside, half_width * along.cross(aside);
    // The whole arrow lies above the cell's top.
    const float over = half_length * std::abs(along.z()) + half_width;
    const Rgb colour = mix_colours(kWeakForce, kStrongForce, strength);
    draw(mesh, top + over * Vec::UnitZ(), axes, colour, colour);
  };
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::coil_builder() {
  const Vec size(0.46F * top_edge_, 0.46F * top_edge_, 0.1F * top_edge_);
  const std::size_t mesh = add_mesh(coil_mesh(segments_), size);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = cell_frame(cell, snapshot);
    // The square root makes weak currents visible.
    const float strength = std::sqrt(std::min(1.0F, std::abs(motion.level)));
    const Rgb core = mix_colours(kIron, motion.level < 0.0F ? kBlue : kRed, strength);
    draw(mesh, f.top, f.axes * size.asDiagonal(), core, kCopper);
  };
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::jet_builder(const scene::ActuatorSpec& spec) {
  const float lean = float_parameter(spec, "lean"), pitch = static_cast<float>(surface_.pitch);
  const float highest = std::min(float_parameter(spec, "reach"), 2.0F * pitch);
  const Vec size(0.42F * top_edge_, 0.42F * top_edge_, 0.12F * top_edge_);
  const std::size_t nozzle = add_mesh(nozzle_mesh(segments_), size),
                    plume = add_mesh(plume_mesh(segments_), {0.45F * pitch, 0.45F * pitch, highest}, true);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = cell_frame(cell, snapshot);
    const float flow = std::clamp(motion.level, 0.0F, 1.0F);
    draw(nozzle, f.top, f.axes * size.asDiagonal(), mix_colours(kRubber, kAir, flow), kInk);
    const Vec mouth = f.top + kPlumeFoot.value * top_edge_ * Vec::UnitZ();
    if (flow < kMinVisibleLevel.value) {
      if (keeps_hidden_parts_)
        draw(plume, mouth, Mat::Zero(), kAir, kAir, kPlumeOpacity.value + kPlumeOpacityGain.value, 0.0F);
      return;
    }
    const Vec up(std::sin(lean) * std::cos(motion.a), std::sin(lean) * std::sin(motion.a), std::cos(lean));
    Mat axes;
    axes << 0.45F * pitch * f.axes.col(0), 0.45F * pitch * f.axes.col(1),
        highest * (kPlumeLength.value + kPlumeLengthGain.value * flow) * (f.axes * up);
    draw(plume, mouth, axes, kAir, kAir, kPlumeOpacity.value + kPlumeOpacityGain.value * flow, 0.0F);
  };
}

float ActuatorGeometry::neighbour_height(std::size_t cell, int row_step, int column_step,
                                         const scene::Snapshot& snapshot) const {
  const int row = static_cast<int>(cell) / surface_.columns + row_step;
  const int column = static_cast<int>(cell) % surface_.columns + column_step;
  const float own = snapshot.height[cell];
  if (row < 0 || column < 0 || row >= surface_.rows || column >= surface_.columns) return own;
  const float neighbour = snapshot.height[surface_.index(row, column)];
  return std::isfinite(neighbour) ? neighbour : own;
}

// The mesh has the size of the tip and, below it, a shaft as long as the pin.
ActuatorGeometry::InstanceBuilder ActuatorGeometry::tip_builder(const scene::ActuatorSpec& spec) {
  const scene::PinTip tip = scene::pin_tip(spec, surface_.pin.top_x, surface_.pin.top_y);
  const float depth = tip.height + static_cast<float>(surface_.pin.length);
  std::vector<Eigen::Vector2f> outline;
  if (tip.shape == scene::TipShape::kHemisphere) {
    constexpr int kRings = 6;
    for (int i = 0; i <= kRings; ++i) {
      const float angle = kQuarterTurn * static_cast<float>(i) / kRings;
      outline.emplace_back(tip.radius * std::sin(angle), tip.radius * (std::cos(angle) - 1.0F));
    }
  } else if (tip.shape == scene::TipShape::kCone) {
    outline = {{0.0F, 0.0F}, {tip.radius, -tip.height}};
  }
  if (!outline.empty()) outline.emplace_back(tip.radius, -depth);
  const Eigen::Vector2f half_edges(0.5F * static_cast<float>(surface_.pin.top_x),
                                   0.5F * static_cast<float>(surface_.pin.top_y));
  const std::size_t mesh =
      add_mesh(outline.empty() ? rounded_prism_mesh(segments_, half_edges, tip.radius, depth)
                               : turned_mesh(segments_, outline, -tip.height - 1e-3F));
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState&) {
    const CellFrame f = cell_frame(cell, snapshot);
    draw(mesh, f.top, f.axes, kRubber, kIvory);
    recess_[cell] = depth;
  };
}

// The tip, whose highest point is the origin of its mesh, and the arms from its lower end to the joints.
ActuatorGeometry::InstanceBuilder ActuatorGeometry::delta_builder(const scene::ActuatorSpec& spec) {
  const scene::Delta delta(spec);
  const auto radius = static_cast<float>(delta.tip_radius), length = static_cast<float>(delta.tip_length),
             workspace = static_cast<float>(delta.workspace_radius),
             arm = static_cast<float>(delta.arm_length);
  const float half_width = 0.15F * radius;
  constexpr int kRings = 6;
  std::vector<Eigen::Vector2f> outline;
  for (const int end : {0, 1})  // the upper, then the lower
    for (int i = 0; i <= kRings; ++i) {
      const float angle = kQuarterTurn * (static_cast<float>(i) / kRings + static_cast<float>(end));
      const float centre = end == 0 ? -radius : radius - length;
      outline.emplace_back(radius * std::sin(angle), centre + radius * std::cos(angle));
    }
  const std::size_t tip_mesh = add_mesh(turned_mesh(segments_, outline, -radius - 1e-3F)),
                    arm_mesh = add_mesh(plate_mesh(), {half_width, half_width, 1.0F});
  std::array<Vec, 3> joints;  // from the cell's centre
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const double direction = scene::Delta::kJointDirections[k];
    joints[k] =
        (delta.joint_radius * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0)).cast<float>();
  }
  const float below = length + static_cast<float>(surface_.pin.length);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const Vec centre = cell_frame(cell, snapshot).top;
    const Vec tip = centre + workspace * Vec(motion.a, motion.b, 0.0F);
    draw(tip_mesh, tip, Mat::Identity(), kRubber, kIvory);
    const Vec upper = tip - length * Vec::UnitZ();
    for (const Vec& joint : joints) {
      const Eigen::Vector2f aside = (centre + joint - tip).head<2>();
      const float drop = std::sqrt(std::max(0.0F, arm * arm - aside.squaredNorm()));
      const Vec half_arm(0.5F * aside.x(), 0.5F * aside.y(), -0.5F * drop);
      const Vec across = half_width * half_arm.unitOrthogonal();
      Mat axes;
      axes << across, half_width * half_arm.cross(across).normalized(), half_arm;
      draw(arm_mesh, upper + half_arm, axes, kInk, kInk);
    }
    recess_[cell] = below;
  };
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::tilting_plate_builder(const scene::ActuatorSpec& spec) {
  const float half_thickness = 0.5F * float_parameter(spec, "thickness");
  const Vec half(0.5F * static_cast<float>(surface_.pin.top_x), 0.5F * static_cast<float>(surface_.pin.top_y),
                 half_thickness);
  const std::size_t mesh = add_mesh(plate_mesh(), half);
  const float below =
      2.0F * half_thickness + half.head<2>().norm() * std::sin(float_parameter(spec, "max_tilt"));
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = cell_frame(cell, snapshot);
    const Mat axes = f.axes * roll_pitch(motion);
    draw(mesh, f.top - half_thickness * Vec(axes.col(2)), axes * half.asDiagonal(), kRubber, kIdle);
    recess_[cell] = below;
  };
}

ActuatorGeometry::InstanceBuilder ActuatorGeometry::vibrating_plate_builder() {
  const auto pitch = static_cast<float>(surface_.pitch);
  constexpr float kHalfThickness = 0.05F;
  const Vec half(0.5F * static_cast<float>(surface_.pin.top_x), 0.5F * static_cast<float>(surface_.pin.top_y),
                 kHalfThickness * pitch);
  const std::size_t mesh = add_mesh(plate_mesh(), half);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = cell_frame(cell, snapshot);
    const auto slope = [&](float low, float high) {
      return std::clamp(0.5F * (high - low) / pitch, -kMaxPlateSlope.value, kMaxPlateSlope.value);
    };
    // Central differences of the heights.
    const float east = slope(neighbour_height(cell, 0, -1, snapshot), neighbour_height(cell, 0, 1, snapshot));
    const float north =
        slope(neighbour_height(cell, 1, 0, snapshot), neighbour_height(cell, -1, 0, snapshot));
    const Vec up = Vec(-east, -north, 1).normalized();
    const Vec x = Vec(1, 0, east).normalized();
    Mat axes;
    axes << half.x() * (f.axes * x), half.y() * (f.axes * up.cross(x)), half.z() * (f.axes * up);
    draw(mesh, f.top - half.z() * Vec::UnitZ(), axes, kRubber,
         mix_colours(kIdle, kVibrating, std::clamp(motion.level, 0.0F, 1.0F)));
    recess_[cell] = 3.0F * half.z();
  };
}

}  // namespace smartsurf::view
