// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/surface/SweepKernels.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/surface/SweepKernels.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/surface/MeetBody-inl.h"
#include "smartsurf/surface/SweepBounds.h"
#include "smartsurf/surface/UprightFacets-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

// Cells [first, last) of a stretch of `count`. The last group is moved back, to end with it: cells that are
// computed twice, or that the body's bounds do not cover, get what they would have got.
template <class Touch>
HWY_INLINE void meet_stretch(const SweepJob& job, const Stretch& stretch, int first, int last, int count,
                             const SensedBody& body, float mark, bool upright, Touch touch) {
  const int wide = static_cast<int>(hn::Lanes(Wide()));
  if (count >= wide) {
    for (int i = first; i < last; i += wide) {
      const int at = std::min(i, count - wide);
      if (meet<Wide>(job, stretch, at, body, mark, upright)) touch(at, at + wide - 1);
    }
  } else {
    for (int i = first; i < last; ++i)
      if (meet<Narrow>(job, stretch, i, body, mark, upright)) touch(i, i);
  }
}

// Between which distances a segment can be as high as the body.
Range heights_met(const SweepJob& job, const SensedBody& b) {
  const float dz = job.direction.z(), top = b.centre.z() + b.reach_z, bottom = b.centre.z() - b.reach_z;
  const float slack =
      1e-5F * (std::abs(top) + std::abs(bottom) + std::abs(job.lowest) + std::abs(job.highest));
  const float over = bottom - job.highest - slack, under = top - job.lowest + slack;
  if (std::abs(dz) < kParallel)
    return over <= 0.0F && under >= 0.0F ? Range{0.0F, job.range} : Range{1.0F, 0.0F};
  return {std::max(0.0F, dz > 0.0F ? over / dz : under / dz),
          std::min(job.range, dz > 0.0F ? under / dz : over / dz)};
}

// The part of t in which segments that start at y are beside the body, as seen from the south.
Range beside(const SweepJob& job, const SensedBody& b, float y, const Range& t) {
  if (std::abs(job.direction.y()) < kParallel) return t;
  const float reach = b.reach_y + 1e-5F * (std::abs(y) + std::abs(b.centre.y()) + b.reach_y);
  const float near = (b.centre.y() - reach - y) / job.direction.y();
  const float far = (b.centre.y() + reach - y) / job.direction.y();
  return {std::max(t.low, std::min(near, far)), std::min(t.high, std::max(near, far))};
}

struct Columns {
  int first, end;
};
Columns columns_within(const SweepJob& job, const SensedBody& b, const Range& t) {
  const Range xs = starts(b.centre.x() - job.origin.x(), b.reach_x, job.direction.x(), t);
  return {first_from(xs.low / job.pitch, job.columns), end_at(xs.high / job.pitch, job.columns)};
}

void touch(const SweepJob& job, int row, int from, int to) {
  std::uint8_t* const touched = job.touched + static_cast<std::ptrdiff_t>(row) * job.blocks;
  for (int block = from / kBlock; block <= to / kBlock; ++block) touched[block] |= 1;
}

void sweep_row(const SweepJob& job, const SensedBody& b, float mark, bool upright, int r, float y,
               Columns columns) {
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(r) * job.columns;
  const Stretch stretch{.x = job.x,
                        .height = job.height != nullptr ? job.height + row : nullptr,
                        .y0 = y,
                        .distance = job.distance + row,
                        .mark = job.mark + row};
  meet_stretch(job, stretch, columns.first, columns.end, job.columns, b, mark, upright,
               [&job, r](int from, int to) { touch(job, r, from, to); });
}

// A ball over no more columns than a vector has lanes, as meet_ball meets it: what is the same for all rows
// is computed once.
void sweep_small_ball(const SweepJob& job, const SensedBody& b, float mark, int r0, int r1, int column) {
  const Wide d;
  const float radius = b.extent.x();
  const auto dx = hn::Sub(hn::LoadU(d, job.x + column), hn::Set(d, b.centre.x()));
  const auto across = hn::Sub(hn::Set(d, radius * radius), hn::Mul(dx, dx));
  const auto lift = hn::Set(d, job.origin.z()), centre = hn::Set(d, b.centre.z()),
             down = hn::Set(d, -job.direction.z());
  for (int r = r0; r < r1; ++r) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * job.columns + column;
    const float dy = static_cast<float>(job.rows - 1 - r) * job.pitch + job.origin.y() - b.centre.y();
    const auto half = hn::Sqrt(hn::Sub(across, hn::Set(d, dy * dy)));  // NaN where the segment passes by
    const auto height = job.height != nullptr ? hn::LoadU(d, job.height + at) : hn::Zero(d);
    const auto shift = hn::Mul(hn::Sub(hn::Add(height, lift), centre), down);
    const auto low = hn::Sub(shift, half), high = hn::Add(half, shift);
    if (keep_nearer<Wide>(job.distance + at, job.mark + at, hn::Max(low, hn::Zero(d)),
                          hn::Ge(high, hn::Zero(d)), job.range, mark))
      touch(job, r, column, column + static_cast<int>(hn::Lanes(d)) - 1);
  }
}

// Where a vector over these columns begins: within one block, if it can.
int window_over(const Columns& all, int lanes, int columns) {
  const int last_in_block = all.first / kBlock * kBlock + kBlock - lanes;
  const int first = all.end <= last_in_block + lanes ? std::min(all.first, last_in_block) : all.first;
  return std::min(std::max(first, 0), columns - lanes);
}

// Upright segments and a piece that planes bound, over as many columns as a vector has lanes.
template <class D>
void sweep_facets_over(const SweepJob& job, const SensedBody& b, float mark, int r0, int r1, int column,
                       UprightFacets& facets) {
  const D d;
  facets.pass<D>(hn::Sub(hn::LoadU(d, job.x + column), hn::Set(d, b.centre.x())));
  for (int r = r0; r < r1; ++r) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * job.columns + column;
    const float y = static_cast<float>(job.rows - 1 - r) * job.pitch + job.origin.y();
    hn::Vec<D> low, high;
    facets.cross<D>(y - b.centre.y(), low, high);
    const auto height = job.height != nullptr ? hn::LoadU(d, job.height + at) : hn::Zero(d);
    const auto start = hn::Sub(hn::Add(height, hn::Set(d, job.origin.z())), hn::Set(d, b.centre.z()));
    const auto inside = hn::Le(low, high);
    const bool up = job.direction.z() > 0.0F;
    const auto from = up ? hn::Sub(low, start) : hn::Sub(start, high);
    const auto until = up ? hn::Sub(high, start) : hn::Sub(start, low);
    if (keep_nearer<D>(job.distance + at, job.mark + at, hn::Max(from, hn::Zero(d)),
                       hn::And(inside, hn::Ge(until, hn::Zero(d))), job.range, mark))
      touch(job, r, column, column + static_cast<int>(hn::Lanes(d)) - 1);
  }
}

template <class D>
void sweep_facets(const SweepJob& job, const SensedBody& b, float mark, int r0, int r1, const Columns& all) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  for (const Facets& piece : b.polyhedron->pieces) {
    UprightFacets facets(piece, b.to_local);
    for (int c = all.first; c < all.end; c += lanes)
      sweep_facets_over<D>(job, b, mark, r0, r1, window_over({c, all.end}, lanes, job.columns), facets);
  }
}

bool has_facets(const SensedBody& b) {
  return (b.shape == scene::ShapeKind::kBox || b.shape == scene::ShapeKind::kSolid) &&
         std::ranges::all_of(b.polyhedron->pieces,
                             [](const Facets& piece) { return UprightFacets::fits(piece); });
}

// Rows that are ready for bodies, from the first of a band.
struct Ready {
  int until;
  const PrepareRows& prepare;

  void reach(int row) {
    if (row <= until) return;
    prepare(until, row);
    until = row;
  }
};

// Between which y a body must be for segments of these rows to meet it: most of another band are far away.
Range near_rows(const SweepJob& job, int begin, int end) {
  if (job.strips != nullptr)
    return {-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};
  const float slack = std::abs(job.direction.y()) * job.range + std::abs(job.origin.y()) + job.pitch;
  return {static_cast<float>(job.rows - end) * job.pitch - slack,
          static_cast<float>(job.rows - 1 - begin) * job.pitch + slack};
}

void sweep_grid(const SweepJob& job, const SensedBody& b, float mark, bool upright, const Range& near,
                int begin, int end, Ready& ready) {
  if (b.centre.y() + b.reach_y < near.low || b.centre.y() - b.reach_y > near.high) return;
  const Range t = heights_met(job, b);
  if (t.empty()) return;
  const float north = static_cast<float>(job.rows - 1) * job.pitch + job.origin.y();
  const Range ys = starts(b.centre.y(), b.reach_y, job.direction.y(), t);
  const int r0 = std::max(begin, first_from((north - ys.high) / job.pitch, job.rows));
  const int r1 = std::min(end, end_at((north - ys.low) / job.pitch, job.rows));
  if (r0 < r1) ready.reach(r1);
  const Columns all = columns_within(job, b, t);
  const int lanes = static_cast<int>(hn::Lanes(Wide()));
  if (upright && b.shape == scene::ShapeKind::kSphere && all.end - all.first <= lanes && job.columns >= lanes)
    return sweep_small_ball(job, b, mark, r0, r1, window_over(all, lanes, job.columns));
  if (upright && has_facets(b))
    return job.columns >= lanes ? sweep_facets<Wide>(job, b, mark, r0, r1, all)
                                : sweep_facets<Narrow>(job, b, mark, r0, r1, all);
  for (int r = r0; r < r1; ++r) {
    const float y = static_cast<float>(job.rows - 1 - r) * job.pitch + job.origin.y();
    if (upright) {
      sweep_row(job, b, mark, true, r, y, all);
    } else if (const Range here = beside(job, b, y, t); !here.empty()) {
      sweep_row(job, b, mark, false, r, y, columns_within(job, b, here));
    }
  }
}

void sweep_strips(const SweepJob& job, const SensedBody& b, float mark, int begin, int end) {
  const StripLayout& s = *job.strips;
  const Range t = heights_met(job, b);
  if (t.empty()) return;
  const Range ys = starts(b.centre.y(), b.reach_y + s.longest_y * t.high, 0.0F, t);
  const Range xs = starts(b.centre.x(), b.reach_x + s.longest_x * t.high, 0.0F, t);
  const int strips = static_cast<int>(s.first.size()) - 1;
  const int s0 = std::max(begin, first_from((ys.low - s.south) / s.height - 1.0F, strips));
  const int s1 = std::min(end, end_at((ys.high - s.south) / s.height, strips));
  for (int strip = s0; strip < s1; ++strip) {
    const int first = s.first[static_cast<std::size_t>(strip)],
              last = s.first[static_cast<std::size_t>(strip) + 1];
    const float* const x = s.x.data() + first;
    const int count = last - first;
    const int c0 = static_cast<int>(std::lower_bound(x, x + count, xs.low) - x);
    const int c1 = static_cast<int>(std::upper_bound(x, x + count, xs.high) - x);
    const Stretch stretch{.x = x,
                          .y = s.y.data() + first,
                          .dx = s.dx.data() + first,
                          .dy = s.dy.data() + first,
                          .height = job.height != nullptr ? job.height + first : nullptr,
                          .distance = job.distance + first,
                          .mark = job.mark + first};
    meet_stretch(job, stretch, c0, c1, count, b, mark, false, [](int, int) {});
  }
}

// Asks for the memory that upright segments of these rows under the body will touch. Not for that of others:
// another thread writes there.
void fetch_ahead(const SweepJob& job, const SensedBody& b, int begin, int end) {
  const auto row_of = [&](float y) { return static_cast<float>(job.rows - 1) - y / job.pitch; };
  const int r0 = std::max(begin, first_from(row_of(b.centre.y() + b.reach_y), job.rows));
  const int r1 = std::min(end, end_at(row_of(b.centre.y() - b.reach_y), job.rows));
  const auto column_of = [&](float x) {
    return std::min(first_from(x / job.pitch, job.columns), job.columns - 1);
  };
  const int west = column_of(b.centre.x() - b.reach_x), east = column_of(b.centre.x() + b.reach_x);
  for (int r = r0; r < r1; ++r) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(r) * job.columns;
    // Of blocks as far apart as two lines of memory are.
    for (int column = west; column / kBlock <= east / kBlock; column += kBlock) {
      const std::ptrdiff_t at = row + std::min(column, job.columns - 1);
      hwy::Prefetch(job.distance + at);
      hwy::Prefetch(job.mark + at);
      if (job.height != nullptr) hwy::Prefetch(job.height + at);
    }
  }
}

void sweep_rows_of_target(const SweepJob& job, int begin, int end, const PrepareRows& prepare) {
  constexpr std::size_t kAhead = 6;  // bodies: about what a trip to memory takes
  constexpr int kNear = 1 << 17;     // cells whose heights, distances and marks stay in a core's own cache
  const bool upright = job.direction.x() == 0.0F && job.direction.y() == 0.0F && job.strips == nullptr;
  const bool far = upright && job.rows * job.columns > kNear;
  const Range near = near_rows(job, begin, end);
  Ready ready{begin, prepare};
  for (std::size_t bundle = 0; bundle < job.bundles.size(); ++bundle) {
    const auto& [south, north] = job.bundles[bundle];
    if (!(north >= near.low && south <= near.high)) continue;
    const std::size_t last = std::min((bundle + 1) * SensedBodies::kBundle, job.bodies.size());
    for (std::size_t k = bundle * SensedBodies::kBundle; k < last; ++k) {
      const SensedBody& body = job.bodies[k];
      if (body.nowhere()) continue;
      if (far && k + kAhead < job.bodies.size()) fetch_ahead(job, job.bodies[k + kAhead], begin, end);
      if (job.strips != nullptr)
        sweep_strips(job, body, job.marks[k], begin, end);
      else
        sweep_grid(job, body, job.marks[k], upright, near, begin, end, ready);
    }
  }
  ready.reach(end);
}

// The pin is a bottomless column. Touching its top is not meeting it: a segment may begin there.
template <class D>
HWY_INLINE bool meet_pin(const PinRow& row, const PinStep& step, int i, float rise, float range, float mark) {
  const D d;
  using V = hn::Vec<D>;
  const V height = row.height != nullptr ? hn::LoadU(d, row.height + i) : hn::Zero(d);
  const V start = hn::Add(height, hn::Set(d, row.lift));
  const V pin = hn::LoadU(d, row.pin + i);
  const auto side = hn::Lt(hn::Add(start, hn::Set(d, rise * step.enter)), pin);
  V reached = hn::Set(d, step.enter);
  auto met = side;
  if (rise < 0.0F) {
    const V down = hn::Div(hn::Sub(pin, start), hn::Set(d, rise));
    met = hn::Or(side, hn::Lt(hn::Add(start, hn::Set(d, rise * step.leave)), pin));
    reached = hn::IfThenElse(side, reached, hn::Max(reached, down));
  }
  const auto there = hn::Gt(height, hn::Set(d, -std::numeric_limits<float>::infinity()));
  return keep_nearer<D>(row.distance + i, row.mark + i, reached, hn::And(there, met), range, mark);
}

bool meet_pins_of_target(const PinRow& row, const PinStep& step, float rise, float range, float mark) {
  using Widest = hn::ScalableTag<float>;
  const int lanes = static_cast<int>(hn::Lanes(Widest()));
  bool any = false;
  int i = 0;
  for (; i + lanes <= row.count; i += lanes) any |= meet_pin<Widest>(row, step, i, rise, range, mark);
  for (; i < row.count; ++i) any |= meet_pin<Narrow>(row, step, i, rise, range, mark);
  return any;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::surface {

HWY_EXPORT(sweep_rows_of_target);
HWY_EXPORT(meet_pins_of_target);

void sweep_rows(const SweepJob& job, int begin, int end, const PrepareRows& prepare) noexcept {
  HWY_DYNAMIC_DISPATCH(sweep_rows_of_target)(job, begin, end, prepare);
}

bool meet_pins(const PinRow& row, const PinStep& step, float rise, float range, float mark) noexcept {
  return HWY_DYNAMIC_DISPATCH(meet_pins_of_target)(row, step, rise, range, mark);
}

}  // namespace smartsurf::surface
#endif
