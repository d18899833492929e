// Which islands the direct solver has: the lanes that make one heavy, the sets of rows that contacts connect,
// and their bodies, points, patches and joints.
#include <algorithm>
#include <atomic>
#include <bit>
#include <cassert>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "smartsurf/world/solver/HeavyIslandSolver.h"

namespace smartsurf::world {
namespace {

// A contact with a load below this many weights of the lighter body carries that body alone: the load of a
// body at rest is below, that of a body that bears another one above.
constexpr float kOwnWeight = 3.0F;
// A narrow base with a load below this many weights does not bear the body alone.
constexpr float kLeastLoad = 0.5F;
// A load is off the middle of its base from half of the way to an edge on.
constexpr float kEccentric = 0.25F;
// A body that lies on another one has a normal with at least this component along the vertical.
constexpr float kLeastRise = 0.5F;
// Bodies without loads as yet, of which so many are connected, may become a chain that bears a heavy one.
constexpr int kMinChain = 2;
// A contact whose load exceeds the sum of its island's weights, forces and momentum by this factor is wedged:
// its load is an internal stress.
constexpr double kMaxLeverage = 8.0;

// Flags of a set of rows that contacts connect.
constexpr std::uint8_t kHeavy = 1;      // the direct solver has it
constexpr std::uint8_t kFresh = 2;      // a body meets what it lies on: it does if it may become a chain
constexpr std::uint8_t kExcluded = 4;   // the sweeps have it in any case
constexpr std::uint8_t kSinking = 8;    // a load presses springs deep: it does from kMinSinkingBodies on
constexpr std::uint8_t kSliding = 16;   // a body meets what it slides on: it becomes no chain
constexpr std::uint8_t kCarried = 32;   // cells move it: the direct solver has it only if it is heavy
constexpr std::uint8_t kUnsteady = 64;  // fast or squeezed: the direct solver has it only if it is pressed
constexpr std::uint8_t kPressed = 128;  // a light body bears a heavy one, or is hit by it
// Deflections as multiples of max_deflection(). One above kDeepAlone makes its island heavy. Those above
// kDeepTogether do so in an island of at least kMinSinkingBodies, where they add up to a visible depth.
constexpr float kDeepAlone = 4.0F, kDeepTogether = 0.5F;
constexpr int kMinSinkingBodies = 8;
// Contacts of faster bodies, or with joints those that close faster, are blows, u/s.
constexpr float kMaxLoadSpeed_ups = 1.0F;
// A heavy body that moves faster towards a light one hits it, u/s.
constexpr float kMinBlow_ups = 0.2F;
// Bodies that slide on each other faster than this are left to the sweeps, unless the load is heavy: friction
// moves their load off the middle.
constexpr float kMaxSlip_ups = 0.05F;
// A body rests on a narrow base if the lesser variance of its points is below this share of its squared
// radius: the sweeps stop its tilt in about as many sweeps as its moment of inertia exceeds that of its base.
constexpr float kNarrow = 0.01F;

// Without branches, so that a loop over the lanes becomes vector code.
bool bears_or_touches(const BatchPoint& p, int lane) {
  return (p.normal_mass[lane] > 0.0F) &
         ((p.normal_impulse[lane] > 0.0F) | (p.separation[lane] <= kTouchingSeparation));
}

// Bit i: a point of lane i bears or touches; closes within the step, in which gravity adds `fall` to its way.
struct LaneMasks {
  unsigned bears, closes;
};
LaneMasks find_lanes(const ContactBatch& o, const BatchPoints& points, float dt_s, float fall) {
  std::int32_t bears[kLanes] = {}, closes[kLanes] = {};
  for (const BatchPoint& p : std::span(points.point + o.first_point, o.point_count))
    for (int i = 0; i < kLanes; ++i) {
      bears[i] |= static_cast<std::int32_t>(bears_or_touches(p, i));
      closes[i] |= static_cast<std::int32_t>((p.normal_mass[i] > 0.0F) &
                                             (p.separation[i] + dt_s * p.approach_speed[i] < fall));
    }
  static_assert(kLanes <= 8);
  LaneMasks masks{0, 0};
  for (unsigned i = 0; i < kLanes; ++i) {
    masks.bears |= static_cast<unsigned>(bears[i]) << i;
    masks.closes |= static_cast<unsigned>(closes[i]) << i;
  }
  return masks;
}

// The loads of the lanes, and the shape of the base that the points of each form that bear or touch.
struct Bases {
  float load[kLanes];  // of all points, mass·u/s
  // The lesser variance of the points in their plane, to a factor of two; infinite for fewer than three,
  // which are no base.
  float width[kLanes];
  // How far the load is off the middle: its squared offset over the variance of the points in that direction.
  float eccentricity[kLanes];
};

// Loops over the lanes, which become vector code.
Bases find_bases(const ContactBatch& o, const BatchPoints& points) {
  Bases bases;
  std::fill_n(bases.load, kLanes, 0.0F);
  std::fill_n(bases.width, kLanes, std::numeric_limits<float>::infinity());
  std::fill_n(bases.eccentricity, kLanes, 0.0F);
  const int end = o.first_point + o.point_count;
  for (int k = o.first_point; k < end; ++k)
    for (int i = 0; i < kLanes; ++i) bases.load[i] += points.point[k].normal_impulse[i];
  if (o.point_count < 3) return bases;
  float count[kLanes] = {}, mean[3][kLanes] = {}, square[6][kLanes] = {}, moment[3][kLanes] = {};
  for (int k = o.first_point; k < end; ++k) {
    const auto& r = points.detail[k].anchor_a;
    for (int i = 0; i < kLanes; ++i) {
      const float weight = bears_or_touches(points.point[k], i) ? 1.0F : 0.0F;
      const float x = weight * r[0][i], y = weight * r[1][i], z = weight * r[2][i];
      count[i] += weight, mean[0][i] += x, mean[1][i] += y, mean[2][i] += z;
      square[0][i] += x * x, square[1][i] += y * y, square[2][i] += z * z;
      square[3][i] += x * y, square[4][i] += y * z, square[5][i] += z * x;
      const float impulse = points.point[k].normal_impulse[i];
      for (int axis = 0; axis < 3; ++axis) moment[axis][i] += impulse * r[axis][i];
    }
  }
  for (int i = 0; i < kLanes; ++i) {
    if (count[i] < 3.0F) continue;
    const float n = 1.0F / count[i], x = n * mean[0][i], y = n * mean[1][i], z = n * mean[2][i];
    const float xx = n * square[0][i] - x * x, yy = n * square[1][i] - y * y, zz = n * square[2][i] - z * z;
    const float xy = n * square[3][i] - x * y, yz = n * square[4][i] - y * z, zx = n * square[5][i] - z * x;
    const float trace = xx + yy + zz, minors = xx * yy - xy * xy + yy * zz - yz * yz + zz * xx - zx * zx;
    bases.width[i] = std::max(minors, 0.0F) / std::max(trace, 1e-20F);
    if (!(bases.load[i] > 0.0F)) continue;
    const float m = 1.0F / bases.load[i], u = m * moment[0][i] - x, v = m * moment[1][i] - y,
                w = m * moment[2][i] - z, squared = u * u + v * v + w * w;
    const float along = u * u * xx + v * v * yy + w * w * zz + 2.0F * (u * v * xy + v * w * yz + w * u * zx);
    bases.eccentricity[i] = squared * squared / std::max(along, 1e-20F);
  }
  return bases;
}

// `up`: the rise of the normal, from b to a.
std::int32_t upper_row(const ContactBatch& o, ContactKind kind, int lane, float up) {
  return up >= 0.0F || !is_pair(kind) ? o.a[lane] : o.b[lane];
}

// Cells that yield have a solver of their own.
bool yields(const ContactBatch& o, const BatchPoints& points, int lane) {
  if (!o.has_impulse_limit) return false;
  const std::span limits(points.limit + o.first_point, static_cast<std::size_t>(o.point_count));
  return std::ranges::any_of(limits, [&](const BatchPointLimit& l) { return l.is_limited(lane); });
}

// Where surfaces press from the side or down, the loads are those of a squeeze, which has no solution that
// holds everything.
bool is_squeezed(const ContactBatch& o, const BatchPoints& points, int lane, const Vec3& gravity) {
  constexpr float kMinRise = 0.5F, kMaxDepth = 0.02F;
  const Vec3 up = -gravity.normalized();
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
    const BatchPoint& p = points.point[k];
    if (!bears_or_touches(p, lane)) continue;
    const Vec3 normal = load_lane(p.normal, lane);
    // Without gravity no side is below.
    const float rise = up.isZero(0.0F) ? 1.0F : up.dot(normal);
    if (std::max(normal.z(), rise) < kMinRise || p.separation[lane] < -kMaxDepth) return true;
  }
  return false;
}

// True if a cell under the lane's body drives or rises.
bool is_carried(const ContactBatch& o, const BatchPoints& points, int lane) {
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
    if (bears_or_touches(points.point[k], lane) &&
        !load_lane(points.detail[k].surface_velocity, lane).isZero(0.0F))
      return true;
  return false;
}

bool is_jointed(const HeavyIslandSolver::Step& step, std::int32_t row) {
  return step.bodies.is_jointed[step.partition.body(row)] != 0;
}

// Contacts of fast bodies are impacts, not loads; but what hangs together by joints drives and carries loads
// at any speed.
bool is_fast(const HeavyIslandSolver::Step& step, std::int32_t row) {
  return !is_jointed(step, row) && Vec3(step.velocity[row].velocity).cast<double>().squaredNorm() >
                                       kMaxLoadSpeed_ups * kMaxLoadSpeed_ups;
}
bool closes_fast(const ContactBatch& o, const BatchPoints& points, int lane) {
  const std::span all(points.point + o.first_point, static_cast<std::size_t>(o.point_count));
  return std::ranges::any_of(all, [&](const BatchPoint& p) {
    return bears_or_touches(p, lane) && p.approach_speed[lane] < -kMaxLoadSpeed_ups;
  });
}

}  // namespace

void HeavyIslandSolver::reset(int member_count, int row_count, int batch_count) {
  bodies_.clear();
  members_.resize(member_count);
  if (std::ssize(bearing_lanes_) < batch_count) bearing_lanes_.resize(batch_count);
  parent_.resize(row_count);
  flags_.resize(parent_.size()), is_borne_.resize(parent_.size()), is_pressed_.resize(parent_.size());
  for (MemberData& m : members_)
    m.heavy_rows.clear(), m.sinking_rows.clear(), m.fresh_rows.clear(), m.sliding_rows.clear(),
        m.pressed_rows.clear();
  islands_.clear();
}

void HeavyIslandSolver::find_heavy_lanes(const Step& step, int batch, ContactKind kind,
                                         const SubstepParams& params, const Member& member) {
  const ContactBatch& o = step.graph.batch(batch);
  const BatchPoints& points = step.points;
  const BodyVelocity* const velocity = step.velocity;
  const Vec3 weight = step.h_s * step.gravity;  // what gravity gives a body in a substep, u/s
  const float weight_impulse = weight.norm(), dt_s = step.h_s / params.substep_fraction;
  const auto [bears, closes] = find_lanes(o, points, dt_s, dt_s * weight_impulse / params.substep_fraction);
  bearing_lanes_[batch] = static_cast<std::uint8_t>(bears);
  if ((bears | closes) == 0) return;
  const Bases bases = find_bases(o, points);
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const bool bears_now = (bears >> static_cast<unsigned>(lane) & 1U) != 0,
               closes_now = (closes >> static_cast<unsigned>(lane) & 1U) != 0;
    const float a = velocity[o.a[lane]].inverse_mass,
                b = is_pair(kind) ? velocity[o.b[lane]].inverse_mass : 0.0F;
    const float lighter = std::max(a, b);
    const bool of_unequal = is_unequal(a, b);
    if (!bears_now && !(closes_now && of_unequal)) continue;
    // The speed that the load gives to its bearer in a substep. The springs of spheres are never stiffened.
    const float loading = bases.load[lane] * lighter;
    const float deflection = (1.0F - params.steady_share) * params.impulse_scale * loading /
                             (params.mass_scale * params.bias_rate);
    // Deflection relative to that of the direct solver.
    const float excess = kind == kGeneralPair ? deflection / max_deflection(kind) : 0.0F;
    const Vec3 normal = load_lane(points.point[o.first_point].normal, lane);  // from b to a
    const float up = -weight.dot(normal);
    const std::int32_t upper = upper_row(o, kind, lane, up);
    const bool lies = weight_impulse > 0.0F && std::abs(up) >= kLeastRise * weight_impulse;
    const float radius = step.bodies.bounding_radius[step.partition.body(upper)];
    const bool is_narrow = lies && bases.width[lane] < kNarrow * radius * radius;
    const Vec3 speed = Vec3(velocity[o.a[lane]].velocity) -
                       (is_pair(kind) ? Vec3(velocity[o.b[lane]].velocity)
                                      : load_lane(points.detail[o.first_point].surface_velocity, lane));
    const bool slides = speed.cross(normal).squaredNorm() > kMaxSlip_ups * kMaxSlip_ups;
    const bool meets = lies && bases.load[lane] == 0.0F && !is_sphere_kind(kind), is_fresh = meets && !slides;
    if (meets && slides) members_[member.index].sliding_rows.push_back(upper);
    // The lighter body of an unequal pair bears the heavier one if it lies below. If it lies on top, it
    // presses only with its own weight and what it bears itself.
    const bool is_below = (a >= b ? -up : up) > 0.0F;
    const Vec3 heavy_speed = Vec3(velocity[a >= b && is_pair(kind) ? o.b[lane] : o.a[lane]].velocity);
    const bool hits = closes_now && (a >= b ? 1.0F : -1.0F) * normal.dot(heavy_speed) > kMinBlow_ups;
    const bool may_bear = of_unequal && (is_below || hits || loading >= kOwnWeight * weight_impulse);
    const bool is_off_centre = !slides && bases.eccentricity[lane] > kEccentric;
    const float heavy_load = is_narrow ? kLeastLoad : is_off_centre ? kOffCentreLoad : kHeavyLoad;
    const bool is_heavy = may_bear || loading > heavy_load * weight_impulse || excess > kDeepAlone;
    const bool is_sinking = excess > kDeepTogether;
    if (!is_heavy && !is_fresh && !is_sinking) continue;
    // build() would exclude these after it had looked at all lanes of the scene.
    const std::int32_t bearer = a >= b ? o.a[lane] : o.b[lane];
    if (!is_pair(kind) && yields(o, points, lane)) continue;
    MemberData& own = members_[member.index];
    if (may_bear) {
      own.pressed_rows.insert(own.pressed_rows.end(), {o.a[lane], o.b[lane]});
      continue;
    }
    if (is_fast(step, bearer) || (!is_pair(kind) && is_squeezed(o, points, lane, weight))) continue;
    if (!is_heavy && !is_pair(kind) && is_carried(o, points, lane)) continue;
    if (is_heavy)
      own.heavy_rows.push_back(bearer);
    else if (is_sinking)
      own.sinking_rows.push_back(bearer);
    else
      own.fresh_rows.push_back({upper, is_narrow ? kHeavy : kFresh});
  }
}

bool HeavyIslandSolver::any_heavy_lane() const {
  return std::ranges::any_of(members_, [](const MemberData& m) {
    return !m.heavy_rows.empty() || !m.sinking_rows.empty() || !m.fresh_rows.empty() ||
           !m.pressed_rows.empty();
  });
}

// ---- sets of rows, which all members unite at once

std::int32_t HeavyIslandSolver::find_root(std::int32_t row) {
  const auto parent = [this](std::int32_t i) { return std::atomic_ref(parent_[i]); };
  for (;;) {
    const std::int32_t next = parent(row).load(std::memory_order_relaxed);
    if (next == row) return row;
    const std::int32_t after = parent(next).load(std::memory_order_relaxed);
    // Any ancestor will do, and a row that has one never becomes a root again.
    if (after != next) parent(row).store(after, std::memory_order_relaxed);
    row = after;
  }
}

void HeavyIslandSolver::unite(std::int32_t row, std::int32_t other) {
  for (;;) {
    row = find_root(row), other = find_root(other);
    if (row == other) return;
    if (row < other) std::swap(row, other);
    std::int32_t expected = row;
    if (std::atomic_ref(parent_[row]).compare_exchange_strong(expected, other, std::memory_order_relaxed))
      return;
  }
}

// Raises a flag of the set that the row is in.
void HeavyIslandSolver::mark(std::int32_t row, std::uint8_t flag) {
  const std::atomic_ref flags(flags_[find_root(row)]);
  if ((flags.load(std::memory_order_relaxed) & flag) == 0) flags.fetch_or(flag, std::memory_order_relaxed);
}

// ---- islands

void HeavyIslandSolver::build(const Step& step, IndexRange own_rows, const Member& member) {
  std::iota(parent_.begin() + own_rows.begin, parent_.begin() + own_rows.end, own_rows.begin);
  for (std::vector<std::uint8_t>* flags : {&flags_, &is_borne_, &is_pressed_})
    std::fill(flags->begin() + own_rows.begin, flags->begin() + own_rows.end, std::uint8_t{0});
  member.arrive_and_wait();
  for (const std::int32_t row : members_[member.index].pressed_rows)
    std::atomic_ref(is_pressed_[row]).store(1, std::memory_order_relaxed);
  member.arrive_and_wait();
  find_own_lanes(step, member);
  member.arrive_and_wait();
  mark_islands(step, own_rows, member);
  member.single([&] { number_islands(step); });
  if (islands_.empty()) return;
  std::erase_if(members_[member.index].lanes, [&](const BearingLane& l) {
    const ContactBatch& o = step.graph.batch(l.batch);
    return body_of(step, o.a[l.lane]) < 0 && (!is_pair(l.kind) || body_of(step, o.b[l.lane]) < 0);
  });
  member.single([&] {
    order_lanes(step);
    collect_patches(step.supports);
    collect_joints(step);
    std::erase_if(islands_, [](const Island& island) { return island.body_count == 0; });
    if (matrices_.size() < islands_.size()) matrices_.resize(islands_.size());
    share_islands();
  });
  const IndexRange own = share_of(member.index);
  for (int i = own.begin; i < own.end; ++i) collect_points(step, islands_[i]);
}

void HeavyIslandSolver::find_own_lanes(const Step& step, const Member& member) {
  std::vector<BearingLane>& lanes = members_[member.index].lanes;
  lanes.clear();
  const bool any_pressed =
      std::ranges::any_of(members_, [](const MemberData& m) { return !m.pressed_rows.empty(); });
  const auto moves = [&](std::int32_t row) { return step.velocity[row].inverse_mass > 0.0F; };
  if (member.is_caller())
    for (const BodyLink& link : step.bodies.links) {
      if (link.b < 0) continue;
      if (step.bodies.is_active(link.a) && step.bodies.is_active(link.b))
        unite(step.partition.row(link.a), step.partition.row(link.b));
    }
  for (const BatchRange& range : step.graph.own_batches(member))
    for (int i = range.first; i < range.first + range.count; ++i) {
      const ContactBatch& o = step.graph.batch(i);
      unsigned left = bearing_lanes_[i];
      // A blow moves a pressed body on to what is about it.
      for (int lane = 0; any_pressed && lane < o.lane_count; ++lane)
        if (is_pressed_[o.a[lane]] != 0 || (is_pair(range.kind) && is_pressed_[o.b[lane]] != 0))
          left |= 1U << static_cast<unsigned>(lane);
      for (; left != 0; left &= left - 1) {
        const int lane = std::countr_zero(left);
        lanes.push_back({i, lane, range.kind, step.graph.rank(range.kind, i, lane)});
        if (is_pair(range.kind) && moves(o.a[lane]) && moves(o.b[lane])) unite(o.a[lane], o.b[lane]);
        const std::span points(step.points.point + o.first_point, static_cast<std::size_t>(o.point_count));
        if (std::ranges::none_of(points, [&](const BatchPoint& p) { return p.normal_impulse[lane] > 0.0F; }))
          continue;
        const float up = -step.gravity.dot(load_lane(points.front().normal, lane));
        std::atomic_ref(is_borne_[upper_row(o, range.kind, lane, up)]).store(1, std::memory_order_relaxed);
      }
    }
}

void HeavyIslandSolver::mark_islands(const Step& step, IndexRange own_rows, const Member& member) {
  const BatchPoints& points = step.points;
  const MemberData& own = members_[member.index];
  for (const std::int32_t row : own.heavy_rows)
    if (step.velocity[row].inverse_mass > 0.0F) mark(row, kHeavy);
  for (const std::int32_t row : own.pressed_rows)
    if (step.velocity[row].inverse_mass > 0.0F) mark(row, kHeavy), mark(row, kPressed);
  for (const std::int32_t row : own.sinking_rows)
    if (step.velocity[row].inverse_mass > 0.0F) mark(row, kSinking);
  for (const std::int32_t row : own.sliding_rows)
    if (step.velocity[row].inverse_mass > 0.0F) mark(row, kSliding);
  for (const auto& [row, flag] : own.fresh_rows)
    if (is_borne_[row] == 0 && step.velocity[row].inverse_mass > 0.0F) mark(row, flag);
  for (const auto& [batch, lane, kind, rank] : own.lanes) {
    const ContactBatch& o = step.graph.batch(batch);
    for (const std::int32_t row : {o.a[lane], o.b[lane]})
      if (is_jointed(step, row) && step.velocity[row].inverse_mass > 0.0F && closes_fast(o, points, lane))
        mark(row, kUnsteady);
    if (!is_pair(kind)) {
      if (yields(o, points, lane)) mark(o.a[lane], kExcluded);
      if (is_squeezed(o, points, lane, step.gravity)) mark(o.a[lane], kUnsteady);
      if (is_carried(o, points, lane)) mark(o.a[lane], kCarried);
    }
  }
  for (int row = own_rows.begin; row < own_rows.end; ++row)
    if (is_fast(step, row)) mark(row, kUnsteady);
  if (!member.is_caller()) return;
  const std::vector<BodyLink>& links = step.bodies.links;
  for (std::size_t k = 0; k < links.size(); ++k)
    for (const std::int32_t body : {links[k].a, links[k].b})
      if (!links[k].is_rigid && body >= 0 && step.bodies.is_active(body) &&
          step.joints.is_in_loop(static_cast<std::int32_t>(k)))
        mark(step.partition.row(body), kExcluded);
}

void HeavyIslandSolver::number_islands(const Step& step) {
  const auto& [graph, bodies, partition, points, velocity, supports, joints, gravity, h_s] = step;
  islands_.clear();
  const auto is_direct = [this](std::int32_t root) {
    const std::uint8_t flags = flags_[root];
    return flags != 0 && (flags & kExcluded) == 0 && ((flags & kCarried) == 0 || (flags & kHeavy) != 0) &&
           ((flags & kUnsteady) == 0 || (flags & kPressed) != 0);
  };
  const auto any_direct = [&](const MemberData& m) {
    const auto is_row_direct = [&](std::int32_t row) { return is_direct(find_root(row)); };
    return std::ranges::any_of(m.heavy_rows, is_row_direct) ||
           std::ranges::any_of(m.pressed_rows, is_row_direct) ||
           std::ranges::any_of(m.sinking_rows, is_row_direct) ||
           std::ranges::any_of(m.fresh_rows, is_row_direct, &Fresh::row);
  };
  if (std::ranges::none_of(members_, any_direct)) return;
  const std::size_t row_count = parent_.size();
  constexpr std::int32_t kNone = -1;
  island_of_row_.assign(row_count, kNone);
  body_of_row_.assign(row_count, kNone);
  is_solved_.assign(row_count, 0);
  // The root of an island is its first row, and comes before the others.
  for (std::size_t i = 0; i < row_count; ++i) {
    const auto row = static_cast<std::int32_t>(i);
    if (!(velocity[row].inverse_mass > 0.0F)) continue;
    const std::int32_t root = find_root(row);
    if (!is_direct(root)) continue;
    if (root == row) {
      island_of_row_[row] = static_cast<std::int32_t>(islands_.size());
      const std::uint8_t flags = flags_[root];
      const bool is_chain = (flags & (kFresh | kSliding)) == kFresh;
      islands_.push_back({.min_bodies = (flags & kHeavy) != 0     ? 1
                                        : is_chain                ? kMinChain
                                        : (flags & kSinking) != 0 ? kMinSinkingBodies
                                                                  : kMaxBodies + 1,
                          .is_pressed = (flags & kPressed) != 0,
                          .is_passive = (flags & kCarried) == 0});
    }
    island_of_row_[row] = island_of_row_[root];
    body_of_row_[row] = islands_[island_of_row_[row]].body_count++;
  }
  std::int32_t bodies_so_far = 0;
  for (Island& island : islands_) {
    island.first_body = bodies_so_far;
    if (island.body_count > kMaxBodies || bodies_so_far + island.body_count > kMaxBodiesInAll ||
        island.body_count < island.min_bodies)
      island.body_count = 0;
    bodies_so_far += island.body_count;
  }
  rows_.resize(bodies_so_far), bodies_.resize(bodies_so_far);
  for (std::size_t i = 0; i < row_count; ++i)
    if (body_of_row_[i] >= 0) {
      Island& island = islands_[island_of_row_[i]];
      if (island.body_count == 0) {
        body_of_row_[i] = kNone;
        continue;
      }
      const std::int32_t place = island.first_body + body_of_row_[i];
      rows_[place] = static_cast<std::int32_t>(i);
      bodies_[place] = {island_of_row_[i],
                        static_cast<std::int32_t>(step.partition.body(static_cast<int>(i)))};
      const float force = bodies.wrench[partition.body(static_cast<int>(i))].force.norm();
      const float speed = h_s * gravity.norm() + Vec3(velocity[i].velocity).norm();
      island.least_inverse_mass =
          std::min(island.least_inverse_mass, static_cast<double>(velocity[i].inverse_mass));
      island.greatest_impulse +=
          kMaxLeverage * static_cast<double>(speed / velocity[i].inverse_mass + h_s * force);
    }
}

// The lanes of all members, by rank. Those of a member are in that order, as its batches are.
void HeavyIslandSolver::merge_lanes() {
  const auto comes_first = [](const BearingLane& a, const BearingLane& b) { return a.rank < b.rank; };
  merged_lanes_.clear();
  for (const MemberData& m : members_) {
    assert(std::is_sorted(m.lanes.begin(), m.lanes.end(), comes_first));
    lanes_.clear();
    std::merge(merged_lanes_.begin(), merged_lanes_.end(), m.lanes.begin(), m.lanes.end(),
               std::back_inserter(lanes_), comes_first);
    merged_lanes_.swap(lanes_);
  }
}

// Island by island, each by rank; makes room for the points.
void HeavyIslandSolver::order_lanes(const Step& step) {
  merge_lanes();
  const auto island_of = [&](const BearingLane& l) -> Island& {
    const ContactBatch& o = step.graph.batch(l.batch);
    return islands_[island_of_row_[body_of(step, o.a[l.lane]) >= 0 ? o.a[l.lane] : o.b[l.lane]]];
  };
  for (Island& island : islands_) island.lane_count = island.point_count = 0;
  for (const BearingLane& l : merged_lanes_) {
    Island& island = island_of(l);
    ++island.lane_count;
    island.point_count += step.graph.batch(l.batch).point_count;
  }
  std::int32_t lanes = 0, points = 0;
  for (Island& island : islands_) {
    island.first_lane = lanes, island.first_point = points;
    lanes += std::exchange(island.lane_count, 0), points += island.point_count;
  }
  lanes_.resize(lanes);
  if (std::ssize(points_) < points) points_.resize(points);
  for (const BearingLane& l : merged_lanes_) {
    Island& island = island_of(l);
    lanes_[island.first_lane + island.lane_count++] = l;
  }
}

void HeavyIslandSolver::collect_points(const Step& step, Island& island) {
  const BatchPoints& points = step.points;
  island.point_count = 0;
  for (const auto& [batch, lane, kind, rank] :
       std::span(lanes_).subspan(island.first_lane, island.lane_count)) {
    const ContactBatch& o = step.graph.batch(batch);
    const bool of_pair = is_pair(kind);
    for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
      const bool may_reach = island.is_pressed && points.point[k].normal_mass[lane] > 0.0F;
      if (!may_reach && !bears_or_touches(points.point[k], lane)) continue;
      Point& p = points_[island.first_point + island.point_count++];
      p.body[0] = body_of(step, o.a[lane]), p.body[1] = of_pair ? body_of(step, o.b[lane]) : -1;
      p.index = k, p.lane = lane;
      p.row[0] = o.a[lane], p.row[1] = of_pair ? o.b[lane] : -1;
      p.kind = kind;
      p.steady_impulse = static_cast<double>(points.point[k].normal_impulse[lane]);
      p.keep(points.point[k]);
    }
  }
}

void HeavyIslandSolver::collect_patches(std::span<SupportPatches> supports) {
  const auto for_each_patch = [&](auto each) {
    for (SupportPatches& list : supports)
      for (SupportPatch& p : list.patches)
        if (body_of_row_[p.row] >= 0 && (!p.moves || p.is_one_belt))
          each(list, p, islands_[island_of_row_[p.row]]);
  };
  for (Island& island : islands_) island.patch_count = 0;
  std::int32_t count = 0;
  for_each_patch(
      [&](const SupportPatches&, const SupportPatch&, Island& island) { ++island.patch_count, ++count; });
  patches_.resize(count);
  count = 0;
  for (Island& island : islands_) island.first_patch = count, count += std::exchange(island.patch_count, 0);
  for_each_patch([&](SupportPatches& list, SupportPatch& p, Island& island) {
    PatchFriction& f = patches_[island.first_patch + island.patch_count++];
    f.list = &list, f.patch = &p;
    f.body[0] = body_of_row_[p.row], f.body[1] = -1;
  });
  elastic_patches_.clear();
  for (SupportPatches& list : supports)
    for (SupportPatch& p : list.patches)
      if (p.is_elastic && body_of_row_[p.row] >= 0)
        elastic_patches_.push_back({.list = &list, .patch = &p, .body = body_of_row_[p.row]});
  const auto island_of = [&](const ElasticPatch& e) { return island_of_row_[e.patch->row]; };
  std::ranges::sort(elastic_patches_, {},
                    [&](const ElasticPatch& e) { return std::pair(island_of(e), e.body); });
  for (Island& island : islands_) island.elastic_count = 0;
  for (std::size_t i = 0; i < elastic_patches_.size(); ++i) {
    Island& island = islands_[island_of(elastic_patches_[i])];
    if (island.elastic_count++ == 0) island.first_elastic = static_cast<std::int32_t>(i);
  }
}

void HeavyIslandSolver::collect_joints(const Step& step) {
  const auto row_of = [&](std::int32_t body) {
    return body >= 0 && step.bodies.is_active(body) ? step.partition.row(body) : -1;
  };
  const auto for_each_joint = [&](auto each) {
    for (std::size_t k = 0; k < step.bodies.links.size(); ++k) {
      const BodyLink& link = step.bodies.links[k];
      JointSprings j{
          .joint = static_cast<std::int32_t>(k), .row = {row_of(link.a), row_of(link.b)}, .part = {}};
      const std::int32_t row = j.row[0] >= 0 ? j.row[0] : j.row[1];
      if (row < 0 || body_of_row_[row] < 0) continue;
      for (Springs& s : j.part)
        for (int side = 0; side < 2; ++side) s.body[side] = j.row[side] >= 0 ? body_of_row_[j.row[side]] : -1;
      each(j, islands_[island_of_row_[row]]);
    }
  };
  for (Island& island : islands_) island.joint_count = 0;
  std::int32_t count = 0;
  for_each_joint([&](const JointSprings&, Island& island) { ++island.joint_count, ++count; });
  joints_.resize(count);
  count = 0;
  for (Island& island : islands_) island.first_joint = count, count += std::exchange(island.joint_count, 0);
  for_each_joint(
      [&](const JointSprings& j, Island& island) { joints_[island.first_joint + island.joint_count++] = j; });
}

// Shares of about equal work.
void HeavyIslandSolver::share_islands() {
  const auto work_of = [](const Island& island) { return island.point_count + 4 * island.body_count; };
  std::int64_t work = 0, before = 0;
  for (const Island& island : islands_) work += work_of(island);
  const std::int64_t members = std::ssize(members_);
  share_begin_.assign(members_.size() + 1, static_cast<std::int32_t>(islands_.size()));
  std::int64_t member = 0;
  for (std::size_t i = 0; i < islands_.size(); ++i) {
    const std::int64_t middle = 2 * before + work_of(islands_[i]);
    for (; member < members && 2 * work * member <= middle * members; ++member)
      share_begin_[member] = static_cast<std::int32_t>(i);
    before += work_of(islands_[i]);
  }
}

}  // namespace smartsurf::world
