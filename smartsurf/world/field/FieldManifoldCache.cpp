#include "smartsurf/world/field/FieldManifoldCache.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/field/SphereOnField.h"
#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {
namespace {

// Greatest relative motion of body and cells for which a cached manifold stays valid: as a fraction of the
// bounding radius, and in u. Features that were farther apart cannot touch yet.
constexpr float kTravelFraction = 0.035F, kMaxTravel = 0.07F;
// Tighter for axisymmetric bodies, where a few points represent a rim and the closest point moves along it.
constexpr float kAxisymmetricTravelFraction = 0.025F, kMaxAxisymmetricTravel = 0.05F;
// Greatest tangential motion at a cached point, likewise as a fraction and in u. The normals stay constant,
// so the error is of second order.
constexpr float kSlipFraction = 0.025F, kMaxSlip = 0.05F;
// Greatest relative motion of cells that were level, u. Beyond it, an edge is exposed that has no cached
// point.
constexpr float kMaxLevelChange = 0.004F;
// Each column has points of one face or edge of a part. As the part rocks, another comes nearer, which has
// none until the manifold is computed again: it may be deeper than the points by this, u.
constexpr float kMissedDepth = 1e-3F;
constexpr float kNoLimit = std::numeric_limits<float>::infinity();

float max_travel(const BodyStore& bodies, std::size_t i) {
  return bodies.is_axisymmetric[i]
             ? std::min(kMaxAxisymmetricTravel, kAxisymmetricTravelFraction * bodies.bounding_radius[i])
             : std::min(kMaxTravel, kTravelFraction * bodies.bounding_radius[i]);
}
// Axes of a shape of revolution that has turned since it had the cached ones: turned about its z, so that the
// same side is the lowest. As it rolls or wobbles, its points stay on that side. The lowest side of a shape
// that stands nearly upright changes too fast for points of an earlier step to show where it is.
Mat3 axes_of_same_side(const Mat3& axes, const Mat3& cached) {
  constexpr float kMinTilt = 0.02F;  // rad
  const float x = axes(2, 0), y = axes(2, 1), cached_x = cached(2, 0), cached_y = cached(2, 1);
  const float scale = std::sqrt((x * x + y * y) * (cached_x * cached_x + cached_y * cached_y));
  if (!(scale > kMinTilt * kMinTilt)) return axes;
  const float cosine = (x * cached_x + y * cached_y) / scale, sine = (cached_x * y - cached_y * x) / scale;
  Mat3 turned;
  turned << cosine * axes.col(0) + sine * axes.col(1), cosine * axes.col(1) - sine * axes.col(0), axes.col(2);
  return turned;
}
float max_slip(float bounding_radius) { return std::min(kMaxSlip, kSlipFraction * bounding_radius); }

}  // namespace

void FieldManifoldCache::swap_in(int chunk, ChunkCache& chunk_cache) {
  if (chunk >= std::ssize(previous_)) previous_.resize(chunk + 1);
  if (previous_[chunk].manifolds.empty() && chunk_cache.manifolds.empty()) return;
  std::swap(previous_[chunk], chunk_cache);
  chunk_cache.manifolds.clear();
  chunk_cache.points.clear();
  chunk_cache.heights.clear();
}

void FieldManifoldCache::build_index(int bodies) {
  manifold_of_body_.clear(bodies);
  for (ChunkCache& chunk_cache : previous_)
    for (CachedManifold& k : chunk_cache.manifolds) {
      k.points = chunk_cache.points.data() + k.first_point;
      k.heights = chunk_cache.heights.data() + k.first_height;
      manifold_of_body_.set(k.body, &k);
    }
}

// True if neither the part of the body near the cells has moved too far relative to any of them, nor level
// cells relative to each other. A cell that moves down cannot cause a new contact.
bool FieldManifoldCache::is_valid(const BodyStore& bodies, std::size_t i, const Mat3& axes, float margin,
                                  const CachedManifold& cached) const {
  const Mat3 rotation = axes * cached.axes.transpose() - Mat3::Identity();
  const Vec3 translation = bodies.origin(i) - cached.centre + rotation * (cached.near_centre - cached.centre);
  const Vec3 rotation_slack = turned_extents(rotation, cached.near_half_extents);
  const float max_motion = std::min(cached.max_travel, cached.clearance - margin);
  const float x = std::abs(translation.x()) + rotation_slack.x(),
              y = std::abs(translation.y()) + rotation_slack.y(), horizontal_squared = x * x + y * y;
  if (!(max_motion > 0.0F && horizontal_squared <= max_motion * max_motion)) return false;
  const HeightChange height_change = height_change_since(cached);
  const float approach = std::max(0.0F, height_change.high - (translation.z() - rotation_slack.z()));
  return horizontal_squared + approach * approach <= max_motion * max_motion &&
         (height_change.high - height_change.low <= kMaxLevelChange || !level_cells_separated(cached));
}

// Least and greatest rise of the cells under the body since the manifold was cached.
FieldManifoldCache::HeightChange FieldManifoldCache::height_change_since(const CachedManifold& cached) const {
  const CellRange& u = cached.cells;
  const int width = u.column_end - u.column_begin;
  HeightChange total{std::numeric_limits<float>::max(), -std::numeric_limits<float>::max()};
  // The difference is NaN where there is no cell; min and max then keep the second operand.
  Float4 low = broadcast4(total.low), high = broadcast4(total.high);
  const float* cached_heights = cached.heights;
  for (int r = u.row_begin; r < u.row_end; ++r, cached_heights += width) {
    const float* const heights = &field_.column_height()[field_.index(r, u.column_begin)];
    if (width >= kSimd4Width) {
      for_each_simd4(width, [&](int c) {
        const Float4 rise = load4(heights + c) - load4(cached_heights + c);
        low = min(rise, low), high = max(rise, high);
      });
    } else {
      for (int c = 0; c < width; ++c) {
        const float rise = heights[c] - cached_heights[c];
        total.low = std::min(total.low, rise), total.high = std::max(total.high, rise);
      }
    }
  }
  return {std::min(total.low, -horizontal_max(-low)), std::max(total.high, horizontal_max(high))};
}

bool FieldManifoldCache::level_cells_separated(const CachedManifold& cached) const {
  const CellRange& u = cached.cells;
  const int width = u.column_end - u.column_begin;
  // Compares `count` contiguous cells with those one stride further.
  auto any_separated = [](int count, const float* cached_heights, int cached_stride, const float* heights,
                          int stride) {
    if (count < kSimd4Width) {
      for (int c = 0; c < count; ++c)
        if (std::abs(cached_heights[c] - cached_heights[c + cached_stride]) <= kLevelTolerance &&
            std::abs(heights[c] - heights[c + stride]) > kMaxLevelChange)
          return true;
      return false;
    }
    Int4 any{};
    for_each_simd4(count, [&](int c) {
      any |= (abs(load4(cached_heights + c) - load4(cached_heights + c + cached_stride)) <= kLevelTolerance) &
             (abs(load4(heights + c) - load4(heights + c + stride)) > kMaxLevelChange);
    });
    return (any[0] | any[1] | any[2] | any[3]) != 0;
  };
  const float* cached_heights = cached.heights;
  for (int r = u.row_begin; r < u.row_end; ++r, cached_heights += width) {
    const float* const heights = &field_.column_height()[field_.index(r, u.column_begin)];
    if (any_separated(width - 1, cached_heights, 1, heights, 1)) return true;
    if (r + 1 < u.row_end && any_separated(width, cached_heights, width, heights, field_.columns))
      return true;
  }
  return false;
}

void FieldManifoldCache::reuse(const CachedManifold& cached, ChunkCache& chunk_cache) const {
  CachedManifold& manifold = chunk_cache.manifolds.emplace_back(cached);
  manifold.first_point = static_cast<std::int32_t>(chunk_cache.points.size());
  manifold.first_height = static_cast<std::int32_t>(chunk_cache.heights.size());
  const CellRange& u = cached.cells;
  const int cell_count = (u.row_end - u.row_begin) * (u.column_end - u.column_begin);
  chunk_cache.points.insert(chunk_cache.points.end(), cached.points, cached.points + cached.point_count);
  chunk_cache.heights.insert(chunk_cache.heights.end(), cached.heights, cached.heights + cell_count);
}

void FieldManifoldCache::rebuild(const BodyStore& bodies, std::size_t i, float margin, const CellRange& cells,
                                 float max_height, ChunkCache& chunk_cache) const {
  thread_local std::vector<FieldCandidate> candidates;
  candidates.clear();
  const Vec3 centre = bodies.origin(i);
  const Mat3& axes = bodies.axes[i];
  const float lead = collect_field_candidates(field_, *bodies.shape[i], centre, axes, margin, candidates);
  CachedManifold& manifold = chunk_cache.manifolds.emplace_back();
  manifold.body = static_cast<std::int32_t>(i);
  manifold.axes = axes;
  manifold.centre = centre;
  manifold.clearance = margin;
  manifold.max_travel = std::min(max_travel(bodies, i), 0.5F * (lead + kMissedDepth));
  // Points higher than the margin above the cells cannot touch before the lower ones have moved too far.
  const Vec3 half_extents = turned_extents(axes, bodies.shape[i]->half_extents);
  Vec3 high = centre + half_extents;
  high.z() = std::min(high.z(), max_height + margin);
  manifold.near_half_extents = 0.5F * (high - (centre - half_extents));
  manifold.near_centre = high - manifold.near_half_extents;
  manifold.cells = cells;
  manifold.first_point = static_cast<std::int32_t>(chunk_cache.points.size());
  manifold.point_count = static_cast<std::int32_t>(candidates.size());
  manifold.first_height = static_cast<std::int32_t>(chunk_cache.heights.size());
  for (const auto& [candidate, part_index, plane] : candidates)
    chunk_cache.points.push_back(
        {axes.transpose() * (candidate.point + candidate.separation * candidate.normal - centre),
         candidate.point, candidate.normal, field_.column_height()[candidate.tag], candidate.tag, part_index,
         plane, candidate.is_apart_twice ? 0.5F * candidate.separation : -kNoLimit});
  for (int r = cells.row_begin; r < cells.row_end; ++r) {
    const float* const row = &field_.column_height()[field_.index(r, 0)];
    chunk_cache.heights.insert(chunk_cache.heights.end(), row + cells.column_begin, row + cells.column_end);
  }
}

void FieldManifoldCache::collide(const BodyStore& bodies, std::size_t i, float margin,
                                 std::span<const Contact> previous, ChunkCache& chunk_cache,
                                 std::vector<Contact>& out) const {
  const CachedManifold* cached = manifold_of_body_[i];
  const Mat3 axes =
      cached && bodies.is_axisymmetric[i] ? axes_of_same_side(bodies.axes[i], cached->axes) : bodies.axes[i];
  if (cached && is_valid(bodies, i, axes, margin, *cached)) {
    reuse(*cached, chunk_cache);
    if (reduce(bodies, i, axes, margin, max_slip(bodies.bounding_radius[i]), previous, chunk_cache, out))
      return;
    chunk_cache.points.resize(chunk_cache.manifolds.back().first_point);
    chunk_cache.heights.resize(chunk_cache.manifolds.back().first_height);
    chunk_cache.manifolds.pop_back();
  }
  const Vec3 centre = bodies.origin(i);
  const Columns columns(field_);
  const float wide_margin = margin + max_travel(bodies, i);
  const Vec3 extent =
      turned_extents(bodies.axes[i], bodies.shape[i]->half_extents) + Vec3::Constant(wide_margin);
  if (centre.z() - extent.z() > field_.max_height) return;
  const CellRange cells = columns.cells_covering(centre.x() - extent.x(), centre.x() + extent.x(),
                                                 centre.y() - extent.y(), centre.y() + extent.y());
  const float max_height = columns.max_height(cells);
  if (centre.z() - extent.z() > max_height) return;
  rebuild(bodies, i, wide_margin, cells, max_height, chunk_cache);
  reduce(bodies, i, bodies.axes[i], margin, kNoLimit, previous, chunk_cache, out);
}

// Updates the separations of the cached points and appends a reduced manifold per plane of each part. Returns
// false and appends nothing if the body has slipped too far at any point: each pair of points was aligned
// along its normal when cached. Likewise if it has come so near to a column that it may miss that another
// normal is to be found.
bool FieldManifoldCache::reduce(const BodyStore& bodies, std::size_t i, const Mat3& axes, float margin,
                                float slip_limit, std::span<const Contact> previous,
                                const ChunkCache& chunk_cache, std::vector<Contact>& out) const {
  const CachedManifold& manifold = chunk_cache.manifolds.back();
  const Vec3 centre = bodies.origin(i);
  const std::size_t first_contact = out.size();
  const float lowest = lowest_point(*bodies.shape[i], centre, axes);
  auto height_change = [&](const CachedPoint& p) { return field_.column_height()[p.cell] - p.top; };
  float slip_squared = 0.0F;  // the greatest, u²
  bool may_have_missed = false;
  const CachedPoint* const end = chunk_cache.points.data() + manifold.first_point + manifold.point_count;
  for (const CachedPoint *begin_of_plane = end - manifold.point_count, *end_of_plane = begin_of_plane;
       begin_of_plane < end; begin_of_plane = end_of_plane) {
    ReductionPoints points;
    for (; end_of_plane < end && points.count() < ReductionPoints::kCapacity &&
           end_of_plane->part_index == begin_of_plane->part_index &&
           end_of_plane->plane == begin_of_plane->plane;
         ++end_of_plane) {
      const Vec3 on_body = centre + axes * end_of_plane->on_body;
      const Vec3 offset = on_body - end_of_plane->on_cell - Vec3(0, 0, height_change(*end_of_plane));
      const float separation = end_of_plane->normal.dot(offset);
      slip_squared = std::max(slip_squared, offset.squaredNorm() - separation * separation);
      may_have_missed |= separation < end_of_plane->least_separation;
      const bool bears = separation <= margin &&
                         !rides_up(end_of_plane->normal, field_.column_height()[end_of_plane->cell], lowest);
      points.add(on_body, bears ? separation : std::numeric_limits<float>::infinity());
    }
    if (slip_limit < kNoLimit && (may_have_missed || slip_squared > slip_limit * slip_limit)) {
      out.resize(first_contact);
      return false;
    }
    int chosen[ReductionPoints::kMaxSelected];
    const int count = points.select(
        chosen, [&](int k) -> const Vec3& { return begin_of_plane[k].normal; },
        [&] { return std::optional<Vec3>(bodies.position[i] + centre_of_load(previous)); });
    for (const int k : std::span(chosen).first(count)) {
      const CachedPoint& p = begin_of_plane[k];
      Contact& c = out.emplace_back();
      c.normal = p.normal;
      c.anchor = points.at(k) - centre;
      c.separation = points.separation(k);
      c.partner = Partner::kCell;
      c.feature_id = p.cell;
      set_surface_velocity(field_, p.on_cell + Vec3(0, 0, height_change(p)), c);
    }
  }
  return true;
}

}  // namespace smartsurf::world
