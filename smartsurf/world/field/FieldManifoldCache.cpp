#include "smartsurf/world/field/FieldManifoldCache.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/field/SphereOnField.h"
#include "smartsurf/world/narrowphase/Simd4.h"

namespace smartsurf::world {
namespace {

// How far body and cells may have moved against each other since they were looked at: as a share of the
// body's reach, and in u. Whatever was farther apart then has not met yet.
constexpr float kWayShare = 0.035F, kMostWay = 0.07F;
// Of what is round one point stands for a whole rim, and the nearest one wanders off along it.
constexpr float kRoundWayShare = 0.025F, kMostRoundWay = 0.05F;
// How far the body may slide meanwhile where it touches, likewise. The normals stay, so that what is off is
// of second order.
constexpr float kSlipShare = 0.025F, kMostSlip = 0.05F;
// How far cells that were level may move against each other, u: where they are no longer, an edge stands out
// that has no point.
constexpr float kMostStep = 0.004F;

float max_travel(const BodyStore& bodies, std::size_t i) {
  return bodies.is_axisymmetric[i] ? std::min(kMostRoundWay, kRoundWayShare * bodies.bounding_radius[i])
                                   : std::min(kMostWay, kWayShare * bodies.bounding_radius[i]);
}
float max_slip(float reach) { return std::min(kMostSlip, kSlipShare * reach); }

}  // namespace

void FieldManifoldCache::swap_in(int chunk, ChunkCache& list) {
  const auto i = static_cast<std::size_t>(chunk);
  if (i >= previous_.size()) previous_.resize(i + 1);
  std::swap(previous_[i], list);
  list.manifolds.clear();
  list.points.clear();
  list.heights.clear();
}

void FieldManifoldCache::build_index(int bodies) {
  first_.assign(static_cast<std::size_t>(bodies), nullptr);
  for (ChunkCache& list : previous_)
    for (CachedManifold& k : list.manifolds) {
      k.points = list.points.data() + k.first_point;
      k.heights = list.heights.data() + k.first_height;
      first_[static_cast<std::size_t>(k.body)] = &k;
    }
}

// Whether nothing of the body that is near the cells has moved too far against any of them, nor these against
// each other. A cell that sinks away from the body meets nothing new.
bool FieldManifoldCache::is_valid(const BodyStore& bodies, std::size_t i, float margin,
                                  const CachedManifold& before) const {
  const Mat3 turn = bodies.axes[i] * before.axes.transpose() - Mat3::Identity();
  const Vec3 by = bodies.position[i] - before.centre + turn * (before.near_centre - before.centre);
  const Vec3 more = turn.cwiseAbs() * before.near_half_extents;
  const float most = std::min(max_travel(bodies, i), before.clearance - margin);
  const float x = std::abs(by.x()) + more.x(), y = std::abs(by.y()) + more.y(), beside = x * x + y * y;
  if (!(most > 0.0F && beside <= most * most)) return false;
  const HeightChange rises = height_change_since(before);
  const float nearer = std::max(0.0F, rises.high - (by.z() - more.z()));
  return beside + nearer * nearer <= most * most &&
         (rises.high - rises.low <= kMostStep || !level_cells_separated(before));
}

// How far the cells under the body rose.
FieldManifoldCache::HeightChange FieldManifoldCache::height_change_since(const CachedManifold& before) const {
  const CellRange& u = before.cells;
  const int width = u.column_end - u.column_begin;
  HeightChange all{std::numeric_limits<float>::max(), -std::numeric_limits<float>::max()};
  // Not a number where there is no cell: the old value stays.
  Float4 low = broadcast4(all.low), high = broadcast4(all.high);
  const float* then = before.heights;
  for (int r = u.row_begin; r < u.row_end; ++r, then += width) {
    const float* const now = &field_.height[static_cast<std::size_t>(field_.index(r, u.column_begin))];
    if (width >= kSimd4Width) {
      for_each_simd4(width, [&](int c) {
        const Float4 rise = load4(now + c) - load4(then + c);
        low = min(rise, low), high = max(rise, high);
      });
    } else {
      for (int c = 0; c < width; ++c) {
        const float rise = now[c] - then[c];
        all.low = std::min(all.low, rise), all.high = std::max(all.high, rise);
      }
    }
  }
  return {std::min(all.low, -horizontal_max(-low)), std::max(all.high, horizontal_max(high))};
}

bool FieldManifoldCache::level_cells_separated(const CachedManifold& before) const {
  const CellRange& u = before.cells;
  const int width = u.column_end - u.column_begin;
  // Of `count` cells that lie side by side, against those `beside` further on.
  auto apart = [](int count, const float* then, int then_beside, const float* now, int now_beside) {
    if (count < kSimd4Width) {
      for (int c = 0; c < count; ++c)
        if (std::abs(then[c] - then[c + then_beside]) <= kLevelTolerance &&
            std::abs(now[c] - now[c + now_beside]) > kMostStep)
          return true;
      return false;
    }
    Int4 any{};
    for_each_simd4(count, [&](int c) {
      any |= (abs(load4(then + c) - load4(then + c + then_beside)) <= kLevelTolerance) &
             (abs(load4(now + c) - load4(now + c + now_beside)) > kMostStep);
    });
    return (any[0] | any[1] | any[2] | any[3]) != 0;
  };
  const float* then = before.heights;
  for (int r = u.row_begin; r < u.row_end; ++r, then += width) {
    const float* const now = &field_.height[static_cast<std::size_t>(field_.index(r, u.column_begin))];
    if (apart(width - 1, then, 1, now, 1)) return true;
    if (r + 1 < u.row_end && apart(width, then, width, now, field_.columns)) return true;
  }
  return false;
}

void FieldManifoldCache::reuse(const CachedManifold& before, ChunkCache& now) const {
  CachedManifold& known = now.manifolds.emplace_back(before);
  known.first_point = static_cast<std::int32_t>(now.points.size());
  known.first_height = static_cast<std::int32_t>(now.heights.size());
  const CellRange& u = before.cells;
  const int cells = (u.row_end - u.row_begin) * (u.column_end - u.column_begin);
  now.points.insert(now.points.end(), before.points, before.points + before.point_count);
  now.heights.insert(now.heights.end(), before.heights, before.heights + cells);
}

void FieldManifoldCache::rebuild(const BodyStore& bodies, std::size_t i, float margin, const CellRange& under,
                                 float highest, ChunkCache& now) const {
  thread_local std::vector<FieldCandidate> touching;
  touching.clear();
  const Vec3& centre = bodies.position[i];
  const Mat3& axes = bodies.axes[i];
  collect_field_candidates(field_, *bodies.shape[i], centre, axes, margin, touching);
  CachedManifold& known = now.manifolds.emplace_back();
  known.body = static_cast<std::int32_t>(i);
  known.axes = axes;
  known.centre = centre;
  known.clearance = margin;
  // Whatever is higher above the cells than the margin has to come farther down than all below it.
  const Vec3 half = axes.cwiseAbs() * bodies.shape[i]->half_extents;
  Vec3 high = centre + half;
  high.z() = std::min(high.z(), highest + margin);
  known.near_half_extents = 0.5F * (high - (centre - half));
  known.near_centre = high - known.near_half_extents;
  known.cells = under;
  known.first_point = static_cast<std::int32_t>(now.points.size());
  known.point_count = static_cast<std::int32_t>(touching.size());
  known.first_height = static_cast<std::int32_t>(now.heights.size());
  for (const auto& [at, piece] : touching)
    now.points.push_back({axes.transpose() * (at.point + at.separation * at.normal - centre), at.point,
                          at.normal, field_.height[static_cast<std::size_t>(at.tag)], at.tag, piece});
  for (int r = under.row_begin; r < under.row_end; ++r) {
    const float* const row = &field_.height[static_cast<std::size_t>(field_.index(r, 0))];
    now.heights.insert(now.heights.end(), row + under.column_begin, row + under.column_end);
  }
}

void FieldManifoldCache::collide(const BodyStore& bodies, std::size_t i, float margin, ChunkCache& now,
                                 std::vector<Contact>& out) const {
  const CachedManifold* before = first_[i];
  if (before && is_valid(bodies, i, margin, *before)) {
    reuse(*before, now);
    if (reduce(bodies, i, margin, max_slip(bodies.bounding_radius[i]), now, out)) return;
    now.points.resize(static_cast<std::size_t>(now.manifolds.back().first_point));
    now.heights.resize(static_cast<std::size_t>(now.manifolds.back().first_height));
    now.manifolds.pop_back();
  }
  const Vec3& centre = bodies.position[i];
  const Columns columns(field_, bodies.width[i]);
  const float wide = margin + max_travel(bodies, i);
  const Vec3 reach = Vec3(bodies.axes[i].cwiseAbs() * bodies.shape[i]->half_extents) + Vec3::Constant(wide);
  if (centre.z() - reach.z() > field_.max_height) return;
  const CellRange under = columns.covering(centre.x() - reach.x(), centre.x() + reach.x(),
                                           centre.y() - reach.y(), centre.y() + reach.y());
  const float highest = columns.max_height(under);
  if (centre.z() - reach.z() > highest) return;
  rebuild(bodies, i, wide, under, highest, now);
  reduce(bodies, i, margin, std::numeric_limits<float>::infinity(), now, out);
}

// Of the points of each piece the few that hold it, where it and the cells are now. False, and nothing found,
// if the body has slid too far at any of the points: each lay straight above its cell's when it was found.
bool FieldManifoldCache::reduce(const BodyStore& bodies, std::size_t i, float margin, float most_slip,
                                const ChunkCache& now, std::vector<Contact>& out) const {
  const CachedManifold& known = now.manifolds.back();
  const Columns columns(field_, bodies.width[i]);
  const Vec3& centre = bodies.position[i];
  const std::size_t before = out.size();
  auto rise = [&](const CachedPoint& p) { return field_.height[static_cast<std::size_t>(p.cell)] - p.top; };
  float slip = 0.0F;  // square
  const CachedPoint* const end = now.points.data() + known.first_point + known.point_count;
  for (const CachedPoint *piece = end - known.point_count, *next = piece; piece < end; piece = next) {
    ReductionPoints points;
    for (; next < end && next->part_index == piece->part_index; ++next) {
      const Vec3 on_body = centre + bodies.axes[i] * next->on_body;
      const Vec3 open = on_body - next->on_cell - Vec3(0, 0, rise(*next));
      const float gap = next->normal.dot(open);
      slip = std::max(slip, open.squaredNorm() - gap * gap);
      points.add(on_body, gap <= margin ? gap : std::numeric_limits<float>::infinity());
    }
    if (slip > most_slip * most_slip) {
      out.resize(before);
      return false;
    }
    int chosen[4];
    const int count = points.select(chosen);
    for (const int k : std::span(chosen).first(static_cast<std::size_t>(count))) {
      const CachedPoint& p = piece[k];
      Contact& c = out.emplace_back();
      c.normal = p.normal;
      c.anchor = points.at(k) - centre;
      c.separation = points.separation(k);
      c.other = kField;
      c.feature_id = p.cell;
      set_surface_velocity(columns, p.cell / field_.columns, p.cell % field_.columns,
                           p.on_cell + Vec3(0, 0, rise(p)), c);
    }
  }
  return true;
}

}  // namespace smartsurf::world
