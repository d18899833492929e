#include "smartsurf/world/FieldMemory.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/ConvexOnField.h"
#include "smartsurf/world/SphereOnField.h"

namespace smartsurf::world {
namespace {

// How far body and cells may have moved against each other since they were looked at: as a share of the
// body's reach, and in u. Whatever was farther apart then has not met yet.
constexpr float kWayShare = 0.04F, kMostWay = 0.08F;
// Of what is round one point stands for a whole rim, and the nearest one wanders off along it.
constexpr float kRoundWayShare = 0.025F, kMostRoundWay = 0.05F;
// How far the body may slide meanwhile where it touches, likewise. The normals stay, so that what is off is
// of second order.
constexpr float kSlipShare = 0.025F, kMostSlip = 0.05F;
// How far cells that were level may move against each other, u: where they are no longer, an edge stands out
// that has no point.
constexpr float kMostStep = 0.004F;

float most_way(const BodyStore& bodies, std::size_t i) {
  return bodies.revolves[i] ? std::min(kMostRoundWay, kRoundWayShare * bodies.reach[i])
                            : std::min(kMostWay, kWayShare * bodies.reach[i]);
}
float most_slip(float reach) { return std::min(kMostSlip, kSlipShare * reach); }

}  // namespace

void FieldMemory::take(int chunk, List& list) {
  const auto i = static_cast<std::size_t>(chunk);
  if (i >= old_.size()) old_.resize(i + 1);
  std::swap(old_[i], list);
  list.bodies.clear();
  list.points.clear();
  list.heights.clear();
}

void FieldMemory::index(int bodies) {
  first_.assign(static_cast<std::size_t>(bodies), nullptr);
  for (List& list : old_)
    for (Known& k : list.bodies) {
      k.points = list.points.data() + k.first;
      k.heights = list.heights.data() + k.first_height;
      first_[static_cast<std::size_t>(k.body)] = &k;
    }
}

// Whether no point of the body has moved too far against any cell under it, nor these against each other.
bool FieldMemory::holds(const BodyStore& bodies, std::size_t i, float margin, const Known& before) const {
  constexpr float kHalfRoot = 0.70710678F;
  const Vec3 by = bodies.position[i] - before.centre;
  const float beside =
      length_of(by.x(), by.y()) + kHalfRoot * bodies.reach[i] * (bodies.axes[i] - before.axes).norm();
  const float most = std::min(most_way(bodies, i), before.clear - margin);
  if (beside > most) return false;
  float low = std::numeric_limits<float>::max(), high = -low;
  const float* then = before.heights;
  for (int r = before.under.row_begin; r < before.under.row_end; ++r) {
    const float* const now = &field_.height[static_cast<std::size_t>(field_.index(r, 0))];
    for (int c = before.under.column_begin; c < before.under.column_end; ++c, ++then) {
      // Not a number where there is no cell.
      const float rise = now[c] - *then;
      low = rise < low ? rise : low;
      high = rise > high ? rise : high;
    }
  }
  const float way = beside + std::max(std::abs(high - by.z()), std::abs(low - by.z()));
  return way <= most && !slid(bodies, i, before) &&
         (high - low <= kMostStep || !level_cells_moved_apart(before));
}

// Whether the body has slid too far at any of its points: each lay straight above its cell's when it was
// found.
bool FieldMemory::slid(const BodyStore& bodies, std::size_t i, const Known& before) const {
  const float most = most_slip(bodies.reach[i]);
  for (int k = 0; k < before.count; ++k) {
    const Point& p = before.points[k];
    const float rise = field_.height[static_cast<std::size_t>(p.cell)] - p.top;
    const Vec3 open = bodies.position[i] + bodies.axes[i] * p.on_body - p.on_cell - Vec3(0, 0, rise);
    const float gap = p.normal.dot(open);
    if (open.squaredNorm() - gap * gap > most * most) return true;
  }
  return false;
}

bool FieldMemory::level_cells_moved_apart(const Known& before) const {
  const CellRange& u = before.under;
  const int width = u.column_end - u.column_begin;
  auto apart = [](float then, float then_beside, float now, float now_beside) {
    return std::abs(then - then_beside) <= kLevelTolerance && std::abs(now - now_beside) > kMostStep;
  };
  const float* then = before.heights;
  for (int r = u.row_begin; r < u.row_end; ++r, then += width) {
    const float* const now = &field_.height[static_cast<std::size_t>(field_.index(r, u.column_begin))];
    for (int c = 0; c < width; ++c) {
      if (c + 1 < width && apart(then[c], then[c + 1], now[c], now[c + 1])) return true;
      if (r + 1 < u.row_end && apart(then[c], then[c + width], now[c], now[c + field_.columns])) return true;
    }
  }
  return false;
}

void FieldMemory::repeat(const Known& before, List& now) const {
  Known& known = now.bodies.emplace_back(before);
  known.first = static_cast<std::int32_t>(now.points.size());
  known.first_height = static_cast<std::int32_t>(now.heights.size());
  const CellRange& u = before.under;
  const int cells = (u.row_end - u.row_begin) * (u.column_end - u.column_begin);
  now.points.insert(now.points.end(), before.points, before.points + before.count);
  now.heights.insert(now.heights.end(), before.heights, before.heights + cells);
}

void FieldMemory::look(const BodyStore& bodies, std::size_t i, float margin, const CellRange& under,
                       List& now) const {
  thread_local std::vector<FieldPoint> touching;
  touching.clear();
  const Vec3& centre = bodies.position[i];
  const Mat3& axes = bodies.axes[i];
  points_near_field(field_, *bodies.shape[i], centre, axes, margin, touching);
  Known& known = now.bodies.emplace_back();
  known.body = static_cast<std::int32_t>(i);
  known.axes = axes;
  known.centre = centre;
  known.clear = margin;
  known.under = under;
  known.first = static_cast<std::int32_t>(now.points.size());
  known.count = static_cast<std::int32_t>(touching.size());
  known.first_height = static_cast<std::int32_t>(now.heights.size());
  for (const auto& [at, piece] : touching)
    now.points.push_back({axes.transpose() * (at.point + at.gap * at.normal - centre), at.point, at.normal,
                          field_.height[static_cast<std::size_t>(at.tag)], at.tag, piece});
  for (int r = under.row_begin; r < under.row_end; ++r) {
    const float* const row = &field_.height[static_cast<std::size_t>(field_.index(r, 0))];
    now.heights.insert(now.heights.end(), row + under.column_begin, row + under.column_end);
  }
}

void FieldMemory::touch(const BodyStore& bodies, std::size_t i, float margin, List& now,
                        std::vector<Contact>& out) const {
  const Known* before = first_[i];
  if (before && holds(bodies, i, margin, *before)) {
    repeat(*before, now);
  } else {
    const Vec3& centre = bodies.position[i];
    const Columns columns(field_, bodies.width[i]);
    const float wide = margin + most_way(bodies, i);
    const Vec3 reach = Vec3(bodies.axes[i].cwiseAbs() * bodies.shape[i]->half) + Vec3::Constant(wide);
    if (centre.z() - reach.z() > field_.max_height) return;
    const CellRange under = columns.covering(centre.x() - reach.x(), centre.x() + reach.x(),
                                             centre.y() - reach.y(), centre.y() + reach.y());
    if (centre.z() - reach.z() > columns.highest(under)) return;
    look(bodies, i, wide, under, now);
  }
  choose(bodies, i, margin, now, out);
}

// Of the points of each piece the few that hold it, where it and the cells are now.
void FieldMemory::choose(const BodyStore& bodies, std::size_t i, float margin, const List& now,
                         std::vector<Contact>& out) const {
  const Known& known = now.bodies.back();
  const Columns columns(field_, bodies.width[i]);
  const Vec3& centre = bodies.position[i];
  auto rise = [&](const Point& p) { return field_.height[static_cast<std::size_t>(p.cell)] - p.top; };
  for (int k = known.first, end = known.first + known.count; k < end;) {
    Candidates candidates;
    for (const int piece = now.points[static_cast<std::size_t>(k)].piece; k < end; ++k) {
      const Point& p = now.points[static_cast<std::size_t>(k)];
      if (p.piece != piece) break;
      const Vec3 on_body = centre + bodies.axes[i] * p.on_body;
      const float gap = p.normal.dot(on_body - p.on_cell) - p.normal.z() * rise(p);
      if (gap <= margin) candidates.add({on_body, p.normal, gap, k});
    }
    candidates.pick([&](const Candidate& found) {
      const Point& p = now.points[static_cast<std::size_t>(found.tag)];
      Contact& c = out.emplace_back();
      c.normal = p.normal;
      c.arm = found.point - centre;
      c.gap = found.gap;
      c.other = kField;
      c.key = p.cell;
      move_with_cell(columns, p.cell / field_.columns, p.cell % field_.columns,
                     p.on_cell + Vec3(0, 0, rise(p)), c);
    });
  }
}

}  // namespace smartsurf::world
