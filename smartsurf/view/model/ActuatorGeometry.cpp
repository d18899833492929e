#include "smartsurf/view/model/ActuatorGeometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "smartsurf/view/model/PaintedMeshes.h"
#include "smartsurf/view/model/Palette.h"

namespace smartsurf::view {
namespace {

using Vec = Eigen::Vector3f;
using Mat = Eigen::Matrix3f;
using Colour = std::array<std::uint8_t, 4>;

constexpr float kQuiet = 0.02F;  // what is weaker than this is not drawn

Colour colour(const Rgb& screen, float opaque = 1.0F) {
  const Rgb light = linear_light(screen);
  const auto byte = [](float v) {
    return static_cast<std::uint8_t>(std::clamp(v, 0.0F, 1.0F) * 255.0F + 0.5F);
  };
  return {byte(light[0]), byte(light[1]), byte(light[2]), byte(opaque)};
}

Rgb between(const Rgb& a, const Rgb& b, float t) {
  Rgb c;
  for (std::size_t i = 0; i < 3; ++i) c[i] = a[i] + (b[i] - a[i]) * t;
  return c;
}

constexpr Rgb kIvory{0.93F, 0.91F, 0.86F}, kInk{0.16F, 0.20F, 0.27F}, kOrange{0.95F, 0.55F, 0.10F};
constexpr Rgb kTyre{0.20F, 0.21F, 0.23F}, kCopper{0.62F, 0.42F, 0.26F}, kIron{0.78F, 0.79F, 0.80F};
constexpr Rgb kRed{0.86F, 0.10F, 0.12F}, kBlue{0.10F, 0.28F, 0.88F}, kAir{0.45F, 0.78F, 0.95F};
constexpr Rgb kPaleArrow{0.98F, 0.80F, 0.45F}, kStrongArrow{0.85F, 0.22F, 0.05F};
constexpr Rgb kRubber{0.70F, 0.72F, 0.74F}, kStill{0.42F, 0.46F, 0.52F}, kShaken{0.98F, 0.72F, 0.12F};

std::array<float, 3> floats(const Vec& v) { return {v.x(), v.y(), v.z()}; }

MeshInstance instance(const Vec& centre, const Mat& axes, const Colour& paint, const Colour& mark) {
  return {floats(axes.col(0)), floats(axes.col(1)), floats(axes.col(2)), floats(centre), paint, mark};
}

Vec vector_of(const std::vector<double>& v, std::size_t first = 0) {
  return Eigen::Vector3d(v[first], v[first + 1], v[first + 2]).cast<float>();
}

float number(const scene::ActuatorSpec& spec, const char* name) {
  return static_cast<float>(spec.number(name));
}

int roundness_for(int cells) { return cells <= 400 ? 24 : cells <= 1600 ? 16 : 12; }

// The shape that a rotor turns, and its highest point at an angle.
struct Turning {
  Vec axis, half_axes;
  std::vector<Vec> points;
  float highest(const Mat& turn) const {
    if (points.empty()) return half_axes.cwiseProduct(Vec(turn.row(2).transpose())).norm();
    float most = -1e30F;
    for (const Vec& p : points) most = std::max(most, turn.row(2).dot(p.transpose()));
    return most;
  }
  float reach() const {
    float most = points.empty() ? half_axes.maxCoeff() : 0.0F;
    for (const Vec& p : points) most = std::max(most, p.norm());
    return most;
  }
};

Turning turning_of(const scene::ActuatorSpec& spec) {
  Turning t{vector_of(spec.numbers("axis")).normalized(), vector_of(spec.numbers("half_axes")), {}};
  if (spec.has("points"))
    for (std::size_t i = 0; i + 2 < spec.numbers("points").size(); i += 3)
      t.points.push_back(vector_of(spec.numbers("points"), i));
  return t;
}

// More corners than these are drawn as the ellipsoid around them: the hull is sought among all triples.
constexpr std::size_t kMostCorners = 32;

}  // namespace

// A cell's own axes, in its place.
struct ActuatorGeometry::CellFrame {
  Vec top;
  Mat axes;
};

ActuatorGeometry::CellFrame ActuatorGeometry::frame_of(std::size_t cell,
                                                       const scene::Snapshot& snapshot) const {
  const int row = static_cast<int>(cell) / surface_.columns,
            column = static_cast<int>(cell) % surface_.columns;
  const Eigen::Vector2f at = surface_.centre(row, column).cast<float>();
  const float angle =
      surface_.cell_poses.empty() ? 0.0F : static_cast<float>(surface_.cell_poses[cell].angle);
  return {{at.x(), at.y(), snapshot.height[cell]}, Eigen::AngleAxisf(angle, Vec::UnitZ()).toRotationMatrix()};
}

ActuatorGeometry::ActuatorGeometry(const scene::SurfaceSpec& surface)
    : surface_(surface),
      top_(static_cast<float>(std::min(surface.pin.top_x, surface.pin.top_y))),
      roundness_(roundness_for(surface.cell_count())) {
  const std::vector<scene::ActuatorSpec> mechanisms = surface.effective_actuators();
  for (std::size_t m = 0; m < mechanisms.size(); ++m) {
    const Work work = work_for(mechanisms[m]);
    if (!work) continue;
    works_.push_back(work);
    for (int row = 0; row < surface.rows; ++row)
      for (int column = 0; column < surface.columns; ++column) {
        const auto cell = static_cast<std::size_t>(surface.index(row, column));
        const std::size_t is =
            surface.actuator_of_cell.empty() ? 0 : static_cast<std::size_t>(surface.actuator_of_cell[cell]);
        if (is != m || surface.is_empty(row, column)) continue;
        if (surface.border_height && surface.is_border(row, column)) continue;
        cells_.push_back(cell);
        work_of_.push_back(works_.size() - 1);
      }
  }
  if (!cells_.empty()) recess_.assign(static_cast<std::size_t>(surface.cell_count()), 0.0F);
}

ActuatorGeometry::Work ActuatorGeometry::work_for(const scene::ActuatorSpec& spec) {
  if (spec.model == "ball") return balls(spec);
  if (spec.model == "wheels") return wheels(spec);
  if (spec.model == "rotor") return rotors(spec);
  if (spec.model == "force_field") return arrows();
  if (spec.model == "magnet") return coils();
  if (spec.model == "air_jet") return jets(spec);
  if (spec.model == "tile") return plates();
  return {};
}

std::size_t ActuatorGeometry::add_kind(PaintedMesh mesh, bool translucent) {
  kinds_.push_back({std::move(mesh), translucent, {}});
  return kinds_.size() - 1;
}

void ActuatorGeometry::update(const scene::Snapshot& snapshot) {
  for (InstancedMesh& kind : kinds_) kind.instances.clear();
  const scene::ActuatorState rest;
  for (std::size_t k = 0; k < cells_.size(); ++k) {
    const std::size_t cell = cells_[k];
    if (!std::isfinite(snapshot.height[cell])) continue;
    works_[work_of_[k]](cell, snapshot,
                        snapshot.actuator_state.empty() ? rest : snapshot.actuator_state[cell]);
  }
}

// The spins about x and about y are shown one after the other: an eye follows the turning, not the order.
ActuatorGeometry::Work ActuatorGeometry::balls(const scene::ActuatorSpec& spec) {
  const float radius = std::min(number(spec, "radius"), 0.5F * top_);
  const std::size_t kind = add_kind(painted_ball(roundness_));
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = frame_of(cell, snapshot);
    const Mat turn = (Eigen::AngleAxisf(motion.b, Vec::UnitY()) * Eigen::AngleAxisf(motion.a, Vec::UnitX()))
                         .toRotationMatrix();
    kinds_[kind].instances.push_back(
        instance(f.top - radius * Vec::UnitZ(), radius * (f.axes * turn), colour(kIvory), colour(kOrange)));
    recess_[cell] = 0.75F * radius;
  };
}

ActuatorGeometry::Work ActuatorGeometry::wheels(const scene::ActuatorSpec& spec) {
  const float radius = std::min(number(spec, "radius"), 0.3F * top_), half_width = 0.11F * top_;
  const std::size_t kind = add_kind(painted_wheel(roundness_));
  const Mat set = Eigen::AngleAxisf(number(spec, "angle"), Vec::UnitZ()).toRotationMatrix();
  const Mat left = Eigen::AngleAxisf(1.5707963F, Vec::UnitZ()).toRotationMatrix();
  const Vec size(radius, half_width, radius);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = frame_of(cell, snapshot);
    const Mat stands = f.axes * set;
    const auto add = [&](const Mat& drives, const Vec& aside, float turned) {
      const Mat turn = Eigen::AngleAxisf(turned, Vec::UnitY()).toRotationMatrix();
      kinds_[kind].instances.push_back(instance(f.top + stands * (top_ * aside) - radius * Vec::UnitZ(),
                                                stands * drives * turn * size.asDiagonal(), colour(kTyre),
                                                colour(kOrange)));
    };
    add(Mat::Identity(), {-0.15F, 0.22F, 0}, motion.a);
    add(left, {0.22F, -0.15F, 0}, motion.b);
    recess_[cell] = 0.9F * radius;
  };
}

ActuatorGeometry::Work ActuatorGeometry::rotors(const scene::ActuatorSpec& spec) {
  const Turning shape = turning_of(spec);
  const bool corners = !shape.points.empty() && shape.points.size() <= kMostCorners;
  const std::size_t kind = add_kind(corners ? painted_hull(shape.points) : painted_ball(roundness_));
  const float scale = std::min(1.0F, 0.55F * static_cast<float>(surface_.pitch) / shape.reach());
  const Vec half = shape.points.empty() ? shape.half_axes : Vec::Constant(shape.reach());
  const Mat size = Mat(corners ? Vec(Vec::Constant(scale)).asDiagonal() : Vec(scale * half).asDiagonal());
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = frame_of(cell, snapshot);
    const Mat turn = Eigen::AngleAxisf(motion.a, shape.axis).toRotationMatrix();
    const float highest = shape.highest(turn);
    kinds_[kind].instances.push_back(instance(f.top - scale * highest * Vec::UnitZ(), f.axes * turn * size,
                                              colour(kIvory), colour(kOrange)));
    recess_[cell] = highest;
  };
}

ActuatorGeometry::Work ActuatorGeometry::arrows() {
  const std::size_t kind = add_kind(painted_arrow());
  const auto pitch = static_cast<float>(surface_.pitch);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const Vec force(motion.a, motion.b, motion.level);
    const float strength = std::min(1.0F, force.norm());
    if (!(strength > kQuiet)) return;
    // No shorter than wide, or its direction would be lost.
    const float half_length = pitch * (0.16F + 0.30F * strength),
                half_width = pitch * (0.09F + 0.07F * strength);
    const Vec along = force.normalized();
    const Vec aside =
        (std::abs(along.z()) < 0.95F ? Vec::UnitZ().cross(along) : Vec::UnitX().cross(along)).normalized();
    Mat axes;
    axes << half_length * along, half_width * aside, half_width * along.cross(aside);
    // All of it stands over the top.
    const float over = half_length * std::abs(along.z()) + half_width;
    const Colour paint = colour(between(kPaleArrow, kStrongArrow, strength));
    kinds_[kind].instances.push_back(
        instance(frame_of(cell, snapshot).top + over * Vec::UnitZ(), axes, paint, paint));
  };
}

ActuatorGeometry::Work ActuatorGeometry::coils() {
  const std::size_t kind = add_kind(painted_coil(roundness_));
  const Vec size(0.46F * top_, 0.46F * top_, 0.1F * top_);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = frame_of(cell, snapshot);
    // The root, so that a weak current shows as well.
    const float strength = std::sqrt(std::min(1.0F, std::abs(motion.level)));
    const Rgb core = between(kIron, motion.level < 0.0F ? kBlue : kRed, strength);
    kinds_[kind].instances.push_back(
        instance(f.top, f.axes * size.asDiagonal(), colour(core), colour(kCopper)));
  };
}

ActuatorGeometry::Work ActuatorGeometry::jets(const scene::ActuatorSpec& spec) {
  const std::size_t nozzle = add_kind(painted_nozzle(roundness_)),
                    plume = add_kind(painted_plume(roundness_), true);
  const float lean = number(spec, "lean"), pitch = static_cast<float>(surface_.pitch);
  const float highest = std::min(number(spec, "reach"), 2.0F * pitch);
  const Vec size(0.42F * top_, 0.42F * top_, 0.12F * top_);
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = frame_of(cell, snapshot);
    const float flow = std::clamp(motion.level, 0.0F, 1.0F);
    kinds_[nozzle].instances.push_back(
        instance(f.top, f.axes * size.asDiagonal(), colour(between(kRubber, kAir, flow)), colour(kInk)));
    if (flow < kQuiet) return;
    const Vec up(std::sin(lean) * std::cos(motion.a), std::sin(lean) * std::sin(motion.a), std::cos(lean));
    Mat axes;
    axes << 0.45F * pitch * f.axes.col(0), 0.45F * pitch * f.axes.col(1),
        highest * (0.2F + 0.8F * flow) * (f.axes * up);
    kinds_[plume].instances.push_back(instance(f.top + 0.1F * top_ * Vec::UnitZ(), axes,
                                               colour(kAir, 0.15F + 0.4F * flow), colour(kAir, 0.0F)));
  };
}

float ActuatorGeometry::height_near(std::size_t cell, int row_step, int column_step,
                                    const scene::Snapshot& snapshot) const {
  const int row = static_cast<int>(cell) / surface_.columns + row_step;
  const int column = static_cast<int>(cell) % surface_.columns + column_step;
  const float own = snapshot.height[cell];
  if (row < 0 || column < 0 || row >= surface_.rows || column >= surface_.columns) return own;
  const float there = snapshot.height[static_cast<std::size_t>(surface_.index(row, column))];
  return std::isfinite(there) ? there : own;
}

ActuatorGeometry::Work ActuatorGeometry::plates() {
  const std::size_t kind = add_kind(painted_plate());
  const auto pitch = static_cast<float>(surface_.pitch);
  constexpr float kHalfThick = 0.05F, kSteepest = 0.7F;
  return [=, this](std::size_t cell, const scene::Snapshot& snapshot, const scene::ActuatorState& motion) {
    const CellFrame f = frame_of(cell, snapshot);
    const auto slope = [&](float low, float high) {
      return std::clamp(0.5F * (high - low) / pitch, -kSteepest, kSteepest);
    };
    const float east = slope(height_near(cell, 0, -1, snapshot), height_near(cell, 0, 1, snapshot));
    const float north = slope(height_near(cell, 1, 0, snapshot), height_near(cell, -1, 0, snapshot));
    const Vec up = Vec(-east, -north, 1).normalized();
    const Vec x = Vec(1, 0, east).normalized();
    Mat axes;
    axes << 0.5F * static_cast<float>(surface_.pin.top_x) * (f.axes * x),
        0.5F * static_cast<float>(surface_.pin.top_y) * (f.axes * up.cross(x)),
        kHalfThick * pitch * (f.axes * up);
    kinds_[kind].instances.push_back(
        instance(f.top - kHalfThick * pitch * Vec::UnitZ(), axes, colour(kRubber),
                 colour(between(kStill, kShaken, std::clamp(motion.level, 0.0F, 1.0F)))));
    recess_[cell] = 3.0F * kHalfThick * pitch;
  };
}

}  // namespace smartsurf::view
