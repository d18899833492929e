// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/surface/raycast/RayKernels.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/surface/raycast/RayKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/surface/raycast/RayBounds.h"
#include "smartsurf/surface/raycast/RayCast-inl.h"
#include "smartsurf/surface/raycast/VerticalFacets-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

// Casts the rays [first, last) of a span of `count` against a body. The last vector is moved back to end
// within the span: recomputing a ray, or testing one outside the body's bounds, does not change its result.
template <class Touch>
HWY_INLINE void cast_span(const RayCastJob& job, const RaySpan& rays, int first, int last, int count,
                          const RayBody& body, float tag, bool vertical, Touch mark_span_dirty) {
  const int lanes = static_cast<int>(hn::Lanes(Wide()));
  if (count >= lanes) {
    for (int i = first; i < last; i += lanes) {
      const int at = std::min(i, count - lanes);
      if (cast_to_body<Wide>(job, rays, at, body, tag, vertical)) mark_span_dirty(at, at + lanes - 1);
    }
  } else {
    for (int i = first; i < last; ++i)
      if (cast_to_body<Scalar>(job, rays, i, body, tag, vertical)) mark_span_dirty(i, i);
  }
}

// The parameters at which a ray may be within the body's z extent.
ScalarRange t_range_at_height(const RayCastJob& job, const RayBody& b) {
  const float dz = job.direction.z(), top = b.centre.z() + b.aabb_half_z,
              bottom = b.centre.z() - b.aabb_half_z;
  const float slack =
      1e-5F * (std::abs(top) + std::abs(bottom) + std::abs(job.min_start_z) + std::abs(job.max_start_z));
  const float over = bottom - job.max_start_z - slack, under = top - job.min_start_z + slack;
  if (std::abs(dz) < kParallelTolerance)
    return over <= 0.0F && under >= 0.0F ? ScalarRange{0.0F, job.range} : ScalarRange{1.0F, 0.0F};
  return {std::max(0.0F, dz > 0.0F ? over / dz : under / dz),
          std::min(job.range, dz > 0.0F ? under / dz : over / dz)};
}

// The part of t in which rays starting at this y may be within the body's y extent.
ScalarRange t_range_at_row(const RayCastJob& job, const RayBody& b, float y, const ScalarRange& t) {
  if (std::abs(job.direction.y()) < kParallelTolerance) return t;
  const float reach = b.aabb_half_y + 1e-5F * (std::abs(y) + std::abs(b.centre.y()) + b.aabb_half_y);
  const float near = (b.centre.y() - reach - y) / job.direction.y();
  const float far = (b.centre.y() + reach - y) / job.direction.y();
  return {std::max(t.low, std::min(near, far)), std::min(t.high, std::max(near, far))};
}

struct ColumnRange {
  int first, end;
};
ColumnRange columns_in_reach(const RayCastJob& job, const RayBody& b, const ScalarRange& t) {
  const ScalarRange xs = start_range(b.centre.x() - job.origin.x(), b.aabb_half_x, job.direction.x(), t);
  return {first_index_from(xs.low / job.pitch, job.columns), end_index_at(xs.high / job.pitch, job.columns)};
}

void mark_dirty(const RayCastJob& job, int row, int from, int to) {
  std::uint8_t* const dirty = job.dirty_blocks + static_cast<std::ptrdiff_t>(row) * job.blocks_per_row;
  for (int block = from / kBlock; block <= to / kBlock; ++block) dirty[block] |= 1;
}

void cast_row(const RayCastJob& job, const RayBody& b, float tag, bool vertical, int r, float y,
              ColumnRange columns) {
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(r) * job.columns;
  const RaySpan rays{.x = job.x,
                     .height = job.height != nullptr ? job.height + row : nullptr,
                     .y0 = y,
                     .distance = job.distance + row,
                     .tag = job.tag + row};
  cast_span(job, rays, columns.first, columns.end, job.columns, b, tag, vertical,
            [&job, r](int from, int to) { mark_dirty(job, r, from, to); });
}

// cast_vertical_to_sphere() for a sphere over at most one vector of columns, with the terms common to all
// rows hoisted.
void cast_vertical_to_small_sphere(const RayCastJob& job, const RayBody& b, float tag, int r0, int r1,
                                   int column) {
  const Wide d;
  const float radius = b.dimensions.x();
  const auto dx = hn::Sub(hn::LoadU(d, job.x + column), hn::Set(d, b.centre.x()));
  const auto across = hn::Sub(hn::Set(d, radius * radius), hn::Mul(dx, dx));
  const auto lift = hn::Set(d, job.origin.z()), centre = hn::Set(d, b.centre.z()),
             down = hn::Set(d, -job.direction.z());
  for (int r = r0; r < r1; ++r) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * job.columns + column;
    const float dy = static_cast<float>(job.rows - 1 - r) * job.pitch + job.origin.y() - b.centre.y();
    const auto half = hn::Sqrt(hn::Sub(across, hn::Set(d, dy * dy)));  // NaN where the ray misses
    const auto height = job.height != nullptr ? hn::LoadU(d, job.height + at) : hn::Zero(d);
    const auto t_shift = hn::Mul(hn::Sub(hn::Add(height, lift), centre), down);
    const auto low = hn::Sub(t_shift, half), high = hn::Add(half, t_shift);
    if (record_closest_hit<Wide>(job.distance + at, job.tag + at, hn::Max(low, hn::Zero(d)),
                                 hn::Ge(high, hn::Zero(d)), job.range, tag))
      mark_dirty(job, r, column, column + static_cast<int>(hn::Lanes(d)) - 1);
  }
}

// Returns the first column of a vector over these columns, placed within one block if possible.
int vector_window(const ColumnRange& all, int lanes, int columns) {
  const int last_in_block = all.first / kBlock * kBlock + kBlock - lanes;
  const int first = all.end <= last_in_block + lanes ? std::min(all.first, last_in_block) : all.first;
  return std::min(std::max(first, 0), columns - lanes);
}

// Vertical rays against a convex hull, over one vector of columns.
template <class D>
void cast_vertical_to_facet_window(const RayCastJob& job, const RayBody& b, float tag, int r0, int r1,
                                   int column, VerticalFacets& facets) {
  const D d;
  facets.set_columns<D>(hn::Sub(hn::LoadU(d, job.x + column), hn::Set(d, b.centre.x())));
  for (int r = r0; r < r1; ++r) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * job.columns + column;
    const float y = static_cast<float>(job.rows - 1 - r) * job.pitch + job.origin.y();
    hn::Vec<D> low, high;
    facets.intersect_row<D>(y - b.centre.y(), low, high);
    const auto height = job.height != nullptr ? hn::LoadU(d, job.height + at) : hn::Zero(d);
    const auto start = hn::Sub(hn::Add(height, hn::Set(d, job.origin.z())), hn::Set(d, b.centre.z()));
    const auto inside = hn::Le(low, high);
    const bool up = job.direction.z() > 0.0F;
    const auto from = up ? hn::Sub(low, start) : hn::Sub(start, high);
    const auto until = up ? hn::Sub(high, start) : hn::Sub(start, low);
    if (record_closest_hit<D>(job.distance + at, job.tag + at, hn::Max(from, hn::Zero(d)),
                              hn::And(inside, hn::Ge(until, hn::Zero(d))), job.range, tag))
      mark_dirty(job, r, column, column + static_cast<int>(hn::Lanes(d)) - 1);
  }
}

template <class D>
void cast_vertical_to_facets(const RayCastJob& job, const RayBody& b, float tag, int r0, int r1,
                             const ColumnRange& all) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  for (const Facets& hull : b.polyhedron->hulls) {
    VerticalFacets facets(hull, b.to_local);
    for (int c = all.first; c < all.end; c += lanes)
      cast_vertical_to_facet_window<D>(job, b, tag, r0, r1, vector_window({c, all.end}, lanes, job.columns),
                                       facets);
  }
}

bool has_vertical_facets(const RayBody& b) {
  return (b.shape == scene::ShapeKind::kBox || b.shape == scene::ShapeKind::kSolid) &&
         std::ranges::all_of(b.polyhedron->hulls,
                             [](const Facets& hull) { return VerticalFacets::fits(hull); });
}

// Tracks the rows of a band that are prepared, in order.
struct RowPreparer {
  int prepared_end;
  const PrepareRows& prepare;

  void prepare_to(int row) {
    if (row <= prepared_end) return;
    prepare(prepared_end, row);
    prepared_end = row;
  }
};

// The y range of the bodies that rays of these rows may hit. Skips most bodies of other bands.
ScalarRange y_range_of_rows(const RayCastJob& job, int begin, int end) {
  if (job.strips != nullptr)
    return {-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};
  const float slack = std::abs(job.direction.y()) * job.range + std::abs(job.origin.y()) + job.pitch;
  return {static_cast<float>(job.rows - end) * job.pitch - slack,
          static_cast<float>(job.rows - 1 - begin) * job.pitch + slack};
}

void cast_grid(const RayCastJob& job, const RayBody& b, float tag, bool vertical, const ScalarRange& y_range,
               int begin, int end, RowPreparer& preparer) {
  if (b.centre.y() + b.aabb_half_y < y_range.low || b.centre.y() - b.aabb_half_y > y_range.high) return;
  const ScalarRange t = t_range_at_height(job, b);
  if (t.empty()) return;
  // Rows [r0, r1) and columns `all` bound the cells whose rays may hit the body.
  const float north = static_cast<float>(job.rows - 1) * job.pitch + job.origin.y();
  const ScalarRange ys = start_range(b.centre.y(), b.aabb_half_y, job.direction.y(), t);
  const int r0 = std::max(begin, first_index_from((north - ys.high) / job.pitch, job.rows));
  const int r1 = std::min(end, end_index_at((north - ys.low) / job.pitch, job.rows));
  if (r0 < r1) preparer.prepare_to(r1);
  const ColumnRange all = columns_in_reach(job, b, t);
  const int lanes = static_cast<int>(hn::Lanes(Wide()));
  if (vertical && b.shape == scene::ShapeKind::kSphere && all.end - all.first <= lanes &&
      job.columns >= lanes)
    return cast_vertical_to_small_sphere(job, b, tag, r0, r1, vector_window(all, lanes, job.columns));
  if (vertical && has_vertical_facets(b))
    return job.columns >= lanes ? cast_vertical_to_facets<Wide>(job, b, tag, r0, r1, all)
                                : cast_vertical_to_facets<Scalar>(job, b, tag, r0, r1, all);
  for (int r = r0; r < r1; ++r) {
    const float y = static_cast<float>(job.rows - 1 - r) * job.pitch + job.origin.y();
    if (vertical) {
      cast_row(job, b, tag, true, r, y, all);
    } else if (const ScalarRange here = t_range_at_row(job, b, y, t); !here.empty()) {
      cast_row(job, b, tag, false, r, y, columns_in_reach(job, b, here));
    }
  }
}

void cast_strips(const RayCastJob& job, const RayBody& b, float tag, int begin, int end) {
  const StripLayout& s = *job.strips;
  const ScalarRange t = t_range_at_height(job, b);
  if (t.empty()) return;
  const ScalarRange ys = start_range(b.centre.y(), b.aabb_half_y + s.max_abs_dy * t.high, 0.0F, t);
  const ScalarRange xs = start_range(b.centre.x(), b.aabb_half_x + s.max_abs_dx * t.high, 0.0F, t);
  const int strips = static_cast<int>(s.first.size()) - 1;
  const int s0 = std::max(begin, first_index_from((ys.low - s.south) / s.height - 1.0F, strips));
  const int s1 = std::min(end, end_index_at((ys.high - s.south) / s.height, strips));
  for (int strip = s0; strip < s1; ++strip) {
    const int first = s.first[strip], last = s.first[strip + 1];
    const float* const x = s.x.data() + first;
    const int count = last - first;
    const int c0 = static_cast<int>(std::lower_bound(x, x + count, xs.low) - x);
    const int c1 = static_cast<int>(std::upper_bound(x, x + count, xs.high) - x);
    const RaySpan rays{.x = x,
                       .y = s.y.data() + first,
                       .dx = s.dx.data() + first,
                       .dy = s.dy.data() + first,
                       .height = job.height != nullptr ? job.height + first : nullptr,
                       .distance = job.distance + first,
                       .tag = job.tag + first};
    cast_span(job, rays, c0, c1, count, b, tag, false, [](int, int) {});
  }
}

void cast_rows_for_target(const RayCastJob& job, int begin, int end, const PrepareRows& prepare) {
  const bool vertical = job.direction.x() == 0.0F && job.direction.y() == 0.0F && job.strips == nullptr;
  const ScalarRange y_range = y_range_of_rows(job, begin, end);
  RowPreparer preparer{begin, prepare};
  for (std::size_t cluster = 0; cluster < job.clusters.size(); ++cluster) {
    const auto& [south, north] = job.clusters[cluster];
    if (!(north >= y_range.low && south <= y_range.high)) continue;
    const std::size_t last = std::min((cluster + 1) * RayBodies::kClusterSize, job.bodies.size());
    for (std::size_t k = cluster * RayBodies::kClusterSize; k < last; ++k) {
      const RayBody& body = job.bodies[k];
      if (body.is_invalid()) continue;
      if (job.strips != nullptr)
        cast_strips(job, body, job.tags[k], begin, end);
      else
        cast_grid(job, body, job.tags[k], vertical, y_range, begin, end, preparer);
    }
  }
  preparer.prepare_to(end);
}

// See PinStep for the pin's shape.
template <class D>
HWY_INLINE bool cast_to_pin(const PinRowRays& row, const PinStep& step, int i, float dz, float range,
                            float tag) {
  const D d;
  using V = hn::Vec<D>;
  const V height = row.start_height != nullptr ? hn::LoadU(d, row.start_height + i) : hn::Zero(d);
  const V start = hn::Add(height, hn::Set(d, row.origin_z));
  const V pin_height = hn::LoadU(d, row.pin_height + i);
  const auto hits_side = hn::Lt(hn::Add(start, hn::Set(d, dz * step.t_enter)), pin_height);
  V t_hit = hn::Set(d, step.t_enter);
  auto hit = hits_side;
  if (dz < 0.0F) {
    const V t_top = hn::Div(hn::Sub(pin_height, start), hn::Set(d, dz));
    hit = hn::Or(hits_side, hn::Lt(hn::Add(start, hn::Set(d, dz * step.t_exit)), pin_height));
    t_hit = hn::IfThenElse(hits_side, t_hit, hn::Max(t_hit, t_top));
  }
  const auto cell_exists = hn::Gt(height, hn::Set(d, -std::numeric_limits<float>::infinity()));
  return record_closest_hit<D>(row.distance + i, row.tag + i, t_hit, hn::And(cell_exists, hit), range, tag);
}

bool cast_to_pins_for_target(const PinRowRays& row, const PinStep& step, float dz, float range, float tag) {
  using Widest = hn::ScalableTag<float>;
  const int lanes = static_cast<int>(hn::Lanes(Widest()));
  bool any_hit = false;
  int i = 0;
  for (; i + lanes <= row.count; i += lanes) any_hit |= cast_to_pin<Widest>(row, step, i, dz, range, tag);
  for (; i < row.count; ++i) any_hit |= cast_to_pin<Scalar>(row, step, i, dz, range, tag);
  return any_hit;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::surface {

HWY_EXPORT(cast_rows_for_target);
HWY_EXPORT(cast_to_pins_for_target);

void cast_rows(const RayCastJob& job, int begin, int end, const PrepareRows& prepare) noexcept {
  HWY_DYNAMIC_DISPATCH(cast_rows_for_target)(job, begin, end, prepare);
}

bool cast_to_pins(const PinRowRays& row, const PinStep& step, float dz, float range, float tag) noexcept {
  return HWY_DYNAMIC_DISPATCH(cast_to_pins_for_target)(row, step, dz, range, tag);
}

}  // namespace smartsurf::surface
#endif
