#include "smartsurf/view/model/Overlay.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::view {
namespace {

using Bytes = std::array<std::uint8_t, 4>;
constexpr Bytes kContact{200, 30, 20, 255}, kSegment{20, 140, 60, 150}, kSelected{255, 190, 0, 255},
    kSpring{230, 40, 160, 255};

std::array<float, 3> floats(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

const Channel* find(const FrameInput& moment, const std::string& name) {
  for (const Channel& channel : moment.channels)
    if (channel.name == name && !channel.values.empty()) return &channel;
  return nullptr;
}

// The edges of a box that is turned and moved.
void add_box(std::vector<Line>& lines, const Eigen::Vector3d& centre, const Eigen::Quaterniond& turn,
             const Eigen::Vector3d& half, const Bytes& colour) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double a : {-1.0, 1.0})
      for (const double b : {-1.0, 1.0}) {
        Eigen::Vector3d from, to;
        from[axis] = -half[axis];
        to[axis] = half[axis];
        from[(axis + 1) % 3] = to[(axis + 1) % 3] = a * half[(axis + 1) % 3];
        from[(axis + 2) % 3] = to[(axis + 2) % 3] = b * half[(axis + 2) % 3];
        lines.push_back({floats(centre + turn * from), floats(centre + turn * to), colour});
      }
}

}  // namespace

void Overlay::apply(const FrameInput& moment, const Tools* tools, DrawOptions& options) {
  lines_.clear();
  heat_.reset();
  colour_cells(moment, options);
  if (settings.trails) {
    trails_.add(moment, settings.trail_s);
    trails_.append_lines(moment.catalogue, lines_);
  } else {
    trails_.clear();
  }
  if (settings.contacts) add_contacts(moment);
  if (settings.sensor_segments) add_segments(moment);
  if (tools) add_selection(moment, *tools);
  options.lines = lines_;
}

void Overlay::plotted_object(const FrameInput& moment) {
  if (settings.trails) trails_.add(moment, settings.trail_s);
}

void Overlay::colour_cells(const FrameInput& moment, DrawOptions& options) {
  const Channel* const channel = settings.channel.empty() ? nullptr : find(moment, settings.channel);
  if (!channel) return;
  HeatScale scale{channel->name, channel->unit, settings.palette, channel->low, channel->high};
  if (settings.own_range) {
    scale.low = settings.low;
    scale.high = settings.high;
  } else if (!(scale.low < scale.high)) {
    const auto [least, most] = std::minmax_element(channel->values.begin(), channel->values.end());
    scale.low = *least;
    scale.high = *most;
  }
  if (!(scale.high != scale.low)) scale.high = scale.low + 1.0F;
  if (settings.near_is_bright) std::swap(scale.low, scale.high);
  options.cell_values = channel->values;
  options.palette = scale.palette;
  options.low = scale.low;
  options.high = scale.high;
  heat_ = scale;
}

// The longest arrow is three pitches long.
void Overlay::add_contacts(const FrameInput& moment) {
  float most = 0.0F;
  for (const ContactMark& contact : moment.contacts) most = std::max(most, contact.force.norm());
  if (!(most > 0.0F)) return;
  const float scale = 3.0F * static_cast<float>(surface_.pitch) / most;
  for (const ContactMark& contact : moment.contacts) {
    const Eigen::Vector3f tip = contact.point + scale * contact.force;
    lines_.push_back(
        {{contact.point.x(), contact.point.y(), contact.point.z()}, {tip.x(), tip.y(), tip.z()}, kContact});
  }
}

// Of every distance sensor (a channel NAME beside its mask NAME_hit) the way to what it sees.
void Overlay::add_segments(const FrameInput& moment) {
  for (const Channel& distance : moment.channels) {
    const Channel* const hit = find(moment, distance.name + "_hit");
    if (!hit || distance.values.empty()) continue;
    for (int row = 0; row < surface_.rows; ++row)
      for (int column = 0; column < surface_.columns; ++column) {
        const std::size_t cell = static_cast<std::size_t>(surface_.index(row, column));
        if (!(hit->values[cell] > 0.5F)) continue;
        const Eigen::Vector2f at = surface_.centre(row, column).cast<float>();
        const float foot = moment.snapshot.height[cell];
        lines_.push_back({{at.x(), at.y(), foot}, {at.x(), at.y(), foot + distance.values[cell]}, kSegment});
      }
  }
}

void Overlay::add_selection(const FrameInput& moment, const Tools& tools) {
  const scene::Snapshot& snapshot = moment.snapshot;
  if (const auto& pull = tools.pull())
    lines_.push_back({floats(Tools::grip_of(*pull, snapshot)), floats(pull->target), kSpring});
  const auto& thing = tools.selected();
  if (!thing) return;
  if (thing->kind == Thing::Kind::kObject) {
    const auto i = index_of(snapshot, thing->object);
    if (!i) return;
    const auto& p = snapshot.position[*i];
    const auto& q = snapshot.orientation[*i];
    add_box(lines_, {p[0], p[1], p[2]}, Eigen::Quaterniond(q[3], q[0], q[1], q[2]),
            1.04 * moment.catalogue[thing->object].half_extents(), kSelected);
    return;
  }
  const Eigen::Vector2d at = surface_.centre(thing->row, thing->column);
  const double top = snapshot.height[static_cast<std::size_t>(surface_.index(thing->row, thing->column))];
  const double length = surface_.pin.length;
  add_box(lines_, {at.x(), at.y(), top - length / 2.0}, Eigen::Quaterniond::Identity(),
          {0.52 * surface_.pin.top_x, 0.52 * surface_.pin.top_y, 0.51 * length}, kSelected);
}

}  // namespace smartsurf::view
