#include "smartsurf/view/interaction/Overlay.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartsurf/view/model/Float3.h"
#include "smartsurf/view/model/Meshes.h"
#include "smartsurf/view/model/PlotData.h"

namespace smartsurf::view {
namespace {

using Rgba8 = std::array<std::uint8_t, 4>;

// Channels with at least this range, such as pressure, declare no limit that their values come near.
constexpr float kNoLimit = 1e6F;

const Channel* find_channel(const FrameInput& input, const std::string& name) {
  for (const Channel& channel : input.channels)
    if (channel.name == name && !channel.values.empty()) return &channel;
  return nullptr;
}

// The twelve edges of an oriented box.
void add_wire_box(std::vector<Line>& lines, const Eigen::Vector3d& centre, const Eigen::Quaterniond& turn,
                  const Eigen::Vector3d& half, const Rgba8& colour) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double a : {-1.0, 1.0})
      for (const double b : {-1.0, 1.0}) {
        Eigen::Vector3d from, to;
        from[axis] = -half[axis];
        to[axis] = half[axis];
        from[(axis + 1) % 3] = to[(axis + 1) % 3] = a * half[(axis + 1) % 3];
        from[(axis + 2) % 3] = to[(axis + 2) % 3] = b * half[(axis + 2) % 3];
        lines.push_back({to_float3(centre + turn * from), to_float3(centre + turn * to), colour});
      }
}

std::vector<float> shape_wireframe(const scene::ObjectSpec& object) {
  switch (object.shape) {
    case scene::ShapeKind::kSphere:
      return sphere_wireframe();
    case scene::ShapeKind::kBox:
      return box_wireframe();
    case scene::ShapeKind::kCylinder:
      return cylinder_wireframe();
    case scene::ShapeKind::kCapsule:
      return capsule_wireframe();
    case scene::ShapeKind::kCone:
      return cone_wireframe();
    case scene::ShapeKind::kSolid:
      return object.solid ? solid_wireframe(*object.solid) : std::vector<float>();
  }
  return {};
}

// The edges of the object's own shape, slightly enlarged.
void add_outline(std::vector<Line>& lines, const Eigen::Vector3d& centre, const Eigen::Quaterniond& turn,
                 const scene::ObjectSpec& object, const Rgba8& colour) {
  constexpr double kEnlarged = 1.03;
  const Eigen::Vector3d half = object.half_extents();
  const std::vector<float> points = shape_wireframe(object);
  const auto placed = [&](std::size_t i) {
    const Eigen::Vector3d corner(points[i], points[i + 1], points[i + 2]);
    Eigen::Vector3d local = corner.cwiseProduct(half);
    if (object.shape == scene::ShapeKind::kSolid) local = corner;
    if (object.shape == scene::ShapeKind::kCapsule)
      local = corner * half.x() + Eigen::Vector3d(0.0, 0.0, std::copysign(half.z() - half.x(), corner.z()));
    return to_float3(centre + turn * (kEnlarged * local));
  };
  for (std::size_t i = 0; i + 6 <= points.size(); i += 6) lines.push_back({placed(i), placed(i + 3), colour});
}

// Three lines along the object's axes that cross in its centre of mass and leave the shape.
void add_centre_of_mass(std::vector<Line>& lines, const Eigen::Vector3d& origin,
                        const Eigen::Quaterniond& turn, const scene::ObjectSpec& object,
                        const Rgba8& colour) {
  const double length = 1.25 * object.half_extents().maxCoeff() + object.centre_of_mass.norm();
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d along = length * Eigen::Vector3d::Unit(axis);
    lines.push_back({to_float3(origin + turn * (object.centre_of_mass - along)),
                     to_float3(origin + turn * (object.centre_of_mass + along)), colour});
  }
}

}  // namespace

void Overlay::apply(const FrameInput& input, const Tools* tools, DrawOptions& options) {
  lines_.clear();
  colour_scale_.reset();
  apply_cell_colours(input, options);
  if (settings.trails) {
    trails_.add(input, settings.trail_length_s);
    trails_.append_lines(input.catalogue, lines_);
  } else {
    trails_.clear();
  }
  if (settings.contact_forces)
    add_contact_forces(input);
  else
    force_scale_.reset();
  if (settings.sensor_rays) add_sensor_rays(input);
  if (tools) add_selection(input, *tools);
  options.lines = lines_;
}

void Overlay::sample_trails(const FrameInput& input) {
  if (settings.trails) trails_.add(input, settings.trail_length_s);
}

// The bright end is a round number, which changes only when the largest value exceeds it or falls below a
// fifth of it.
void Overlay::fit_to_values(const Channel& channel, ColourScale& scale) {
  float largest = 0.0F;
  for (const float value : channel.values)
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  if (std::exchange(fitted_channel_, channel.name) != channel.name) fitted_high_ = 0.0F;
  if (largest > fitted_high_ || (largest > 0.0F && largest < 0.2F * fitted_high_))
    fitted_high_ = static_cast<float>(round_up(double{largest}));
  scale.high = fitted_high_ > 0.0F ? fitted_high_ : 1.0F;  // 1: nothing but zeros yet
  if (scale.low < 0.0F) scale.low = -scale.high;
}

void Overlay::apply_cell_colours(const FrameInput& input, DrawOptions& options) {
  const Channel* const channel = settings.channel.empty() ? nullptr : find_channel(input, settings.channel);
  if (!channel) return;
  ColourScale scale{channel->name, channel->unit, settings.palette, channel->low, channel->high};
  if (settings.manual_range) {
    scale.low = settings.low;
    scale.high = settings.high;
  } else if (!(scale.low < scale.high)) {
    scale.low = std::numeric_limits<float>::infinity();
    scale.high = -scale.low;
    for (const float value : channel->values) {
      if (!std::isfinite(value)) continue;
      scale.low = std::min(scale.low, value);
      scale.high = std::max(scale.high, value);
    }
    if (!(scale.low <= scale.high)) scale.low = scale.high = 0.0F;
  } else if (scale.high >= kNoLimit) {
    fit_to_values(*channel, scale);
  }
  if (!(scale.high != scale.low)) scale.high = scale.low + 1.0F;
  if (settings.reverse_palette) std::swap(scale.low, scale.high);
  options.cell_values = channel->values;
  if (const Channel* const hit = find_channel(input, channel->name + "_hit"); hit && !hit->values.empty()) {
    // A distance sensor that sees nothing reports its range, which is not a distance.
    seen_.resize(channel->values.size());
    for (std::size_t i = 0; i < seen_.size(); ++i)
      seen_[i] = hit->values[i] > 0.5F ? channel->values[i] : std::numeric_limits<float>::quiet_NaN();
    options.cell_values = seen_;
    scale.has_gaps = true;
  }
  options.palette = scale.palette;
  options.low = scale.low;
  options.high = scale.high;
  colour_scale_ = scale;
}

void Overlay::add_contact_forces(const FrameInput& input) {
  float max_force = 0.0F;
  for (const ContactMark& contact : input.contacts) max_force = std::max(max_force, contact.force.norm());
  if (!(max_force > 0.0F)) return force_scale_.reset();
  if (!force_scale_ || max_force > force_scale_->force || max_force < 0.2 * force_scale_->force)
    force_scale_ = {round_up(double{max_force}), 3.0 * surface_.pitch};
  const auto scale = static_cast<float>(force_scale_->length / force_scale_->force);
  for (const ContactMark& contact : input.contacts) {
    const Eigen::Vector3f tip = contact.point + scale * contact.force;
    lines_.push_back({{contact.point.x(), contact.point.y(), contact.point.z()},
                      {tip.x(), tip.y(), tip.z()},
                      kContactColour});
  }
}

// Draws a line from each cell with a detection to the detected point. A distance sensor is a channel NAME
// with a hit mask NAME_hit.
void Overlay::add_sensor_rays(const FrameInput& input) {
  for (const Channel& distance : input.channels) {
    const Channel* const hit = find_channel(input, distance.name + "_hit");
    if (!hit || distance.values.empty()) continue;
    const std::array<double, 3> from_top = distance.origin.value_or(std::array{0.0, 0.0, 0.0}),
                                along = distance.direction.value_or(std::array{0.0, 0.0, 1.0});
    const Eigen::Vector3d origin(from_top.data()), direction(along.data());
    for (int row = 0; row < surface_.rows; ++row)
      for (int column = 0; column < surface_.columns; ++column) {
        const int cell = surface_.index(row, column);
        if (!(hit->values[cell] > 0.5F)) continue;
        const Eigen::Vector2d centre = surface_.centre(row, column);
        const Eigen::AngleAxisd turn(surface_.cell_poses.empty() ? 0.0 : surface_.cell_poses[cell].angle,
                                     Eigen::Vector3d::UnitZ());
        const Eigen::Vector3d from =
            Eigen::Vector3d(centre.x(), centre.y(), input.snapshot.height[cell]) + turn * origin;
        lines_.push_back({to_float3(from), to_float3(from + distance.values[cell] * (turn * direction)),
                          kSensorRayColour});
      }
  }
}

void Overlay::add_selection(const FrameInput& input, const Tools& tools) {
  const scene::Snapshot& snapshot = input.snapshot;
  if (const auto& pull = tools.pull())
    lines_.push_back(
        {to_float3(Tools::anchor_position(*pull, snapshot)), to_float3(pull->target), kSpringColour});
  const auto& item = tools.selected();
  if (!item) return;
  if (item->kind == SceneItem::Kind::kObject) {
    const auto i = find_object_index(snapshot, item->object);
    if (!i) return;
    const auto& p = snapshot.position[*i];
    const auto& q = snapshot.orientation[*i];
    const Eigen::Vector3d origin(p[0], p[1], p[2]);
    const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
    const scene::ObjectSpec& object = input.catalogue[item->object];
    add_outline(lines_, origin, turn, object, kSelectionColour);
    if (!object.centre_of_mass.isZero(0.0))
      add_centre_of_mass(lines_, origin, turn, object, kSelectionColour);
    return;
  }
  const Eigen::Vector2d at = surface_.centre(item->row, item->column);
  const double top = snapshot.height[surface_.index(item->row, item->column)];
  const double length = surface_.pin.length;
  add_wire_box(lines_, {at.x(), at.y(), top - length / 2.0}, Eigen::Quaterniond::Identity(),
               {0.52 * surface_.pin.top_x, 0.52 * surface_.pin.top_y, 0.51 * length}, kSelectionColour);
}

}  // namespace smartsurf::view
