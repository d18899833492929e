// The impulses of the points of a generation: sweeps over the points, shared by the team, and the limit of
// their energy.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>

#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/ImpactSolver.h"

namespace smartsurf::world {
namespace {

constexpr int kNormalSweeps = 32, kNormalSweepsPerFrictionSweep = 4;
// Sweeps over fewer points stay on one thread.
constexpr std::size_t kMinSharedPoints = 192;

using Vec = Eigen::Map<Vec3>;

}  // namespace

// ---- sweeps of all members

void ImpactSolver::run_sweeps(const Member& member, Sweeps sweeps, int max_sweeps) {
  sweeps_ = sweeps, max_sweeps_ = max_sweeps;
  if (member.member_count == 1 || !shares_ || points_.size() < kMinSharedPoints)
    return run_own_sweeps({0, 1, alone_});
  const auto begin = std::chrono::steady_clock::now();
  share_points(member.member_count);
  member.arrive_and_wait();
  run_own_sweeps(member);
  take_changes();
  // Where other programs keep the cores busy, a thread alone is faster. That changes no result.
  constexpr double kVisit_s = 40e-9;  // at most, on one thread
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  shares_ = taken.count() < kVisit_s * static_cast<double>(points_.size() * members_[member.index].sweep);
}

void ImpactSolver::run_own_sweeps(const Member& member) {
  if (member.member_count > 1) copy_points(members_[member.index]);
  if (sweeps_ == Sweeps::kPoints)
    solve_points(max_sweeps_, member);
  else
    solve_normals(max_sweeps_, member);
  if (member.member_count == 1) return;
  return_points(members_[member.index]);
  member.arrive_and_wait();
}

// Gives the points that are new to the members.
void ImpactSolver::share_points(int member_count) {
  if (points_.size() >= 2 * points_at_cut_) choose_cuts(member_count);
  const auto member_of = [&](std::int32_t row) {
    return std::ranges::upper_bound(cut_rows_, row) - cut_rows_.begin();
  };
  for (; shared_points_ < points_.size(); ++shared_points_) {
    const Point& p = points_[shared_points_];
    const auto member = member_of(p.row_a);
    OwnPoint& own = members_[member].points.emplace_back();
    own.index = static_cast<std::int32_t>(shared_points_);
    own.turn_a = passing_[p.row_a].points++;
    if (p.row_b < 0) continue;
    Passing& b = passing_[p.row_b];
    own.turn_b = b.points++;
    if (b.is_shared || member_of(p.row_b) == member) continue;
    b.is_shared = true;
    shared_rows_.push_back(p.row_b);
  }
  for (const std::int32_t row : shared_rows_) passing_[row].turn = 0;
  for (MemberState& m : members_) m.changes.clear(), m.sweep = 0;
}

// Cuts the rows where each member gets about as many of the present points, and where few of these have one
// body on either side.
void ImpactSolver::choose_cuts(int member_count) {
  constexpr int kPassingCost = 8;  // of a body from core to core, in visits of points
  const auto rows = static_cast<std::int32_t>(version_.size());
  row_points_.assign(version_.size() + 1, {});
  for (const Point& p : points_) {
    ++row_points_[p.row_a].points;
    passing_[p.row_a] = {};
    if (p.row_b < 0) continue;
    passing_[p.row_b] = {};
    ++row_points_[std::min(p.row_a, p.row_b) + 1].across;
    --row_points_[std::max(p.row_a, p.row_b) + 1].across;
  }
  cut_rows_.assign(member_count - 1, 0);
  for (int m = 1; m < member_count; ++m) {
    const double even = static_cast<double>(points_.size()) * m / member_count;
    double least = std::numeric_limits<double>::infinity();
    for (std::int32_t row = 0, before = 0, across = 0; row < rows; before += row_points_[row++].points) {
      across += row_points_[row].across;
      const double cost = std::abs(before - even) + kPassingCost * across;
      if (cost < least) least = cost, cut_rows_[m - 1] = row;
    }
    if (m > 1) cut_rows_[m - 1] = std::max(cut_rows_[m - 1], cut_rows_[m - 2]);
  }
  points_at_cut_ = points_.size();
  shared_points_ = 0;
  shared_rows_.clear();
  for (MemberState& m : members_) m.points.clear(), m.copies.clear();
}

// Copies the member's new points from the list.
void ImpactSolver::copy_points(MemberState& own) const {
  for (std::size_t k = own.copies.size(); k < own.points.size(); ++k)
    own.copies.push_back(points_[own.points[k].index]);
  for (std::size_t k = 0; k < own.points.size(); ++k) {
    const Point& p = own.copies[k];
    own.points[k].is_shared = passing_[p.row_a].is_shared || (p.row_b >= 0 && passing_[p.row_b].is_shared);
  }
}

// Writes to the list what the sweeps have changed.
void ImpactSolver::return_points(const MemberState& own) {
  for (std::size_t k = 0; k < own.points.size(); ++k) {
    Point& p = points_[own.points[k].index];
    p.impulse = own.copies[k].impulse;
    p.seen_normal = own.copies[k].seen_normal, p.seen_friction = own.copies[k].seen_friction;
  }
}

// The bodies that the members have changed, in the order in which one thread would have.
void ImpactSolver::take_changes() {
  changes_.clear();
  for (const MemberState& m : members_) changes_.insert(changes_.end(), m.changes.begin(), m.changes.end());
  std::ranges::sort(changes_, {}, &Change::order);
  for (const Change& c : changes_) changed_bodies_.push_back(c.body);
}

// The greatest of all members' values, at the end of a sweep.
float ImpactSolver::greatest_of_members(float value, const Member& member) {
  if (member.member_count == 1) return value;
  MemberState& own = members_[member.index];
  // A member reads the results of one sweep while others write the next.
  const std::uint32_t slot = own.sweep++ % 2;
  own.result[slot] = value;
  member.arrive_and_wait();
  for (const MemberState& m : members_) value = std::max(value, m.result[slot]);
  return value;
}

void ImpactSolver::wait_for_turn(const Point& p, const OwnPoint& own, std::uint32_t sweep, bool is_backward) {
  const auto wait = [&](std::int32_t row, std::uint32_t turn) {
    Passing& passing = passing_[row];
    if (!passing.is_shared) return;
    const std::uint32_t wanted = sweep * passing.points + (is_backward ? passing.points - 1 - turn : turn);
    const std::atomic_ref<std::uint32_t> turns_so_far(passing.turn);
    if (common::spin_until([&] { return turns_so_far.load(std::memory_order_acquire) == wanted; })) return;
    for (std::uint32_t now = 0; (now = turns_so_far.load(std::memory_order_acquire)) != wanted;)
      turns_so_far.wait(now, std::memory_order_acquire);
  };
  wait(p.row_a, own.turn_a);
  if (p.row_b >= 0) wait(p.row_b, own.turn_b);
}

void ImpactSolver::end_turn(const Point& p) {
  for (const std::int32_t row : {p.row_a, p.row_b}) {
    if (row < 0 || !passing_[row].is_shared) continue;
    const std::atomic_ref<std::uint32_t> turns_so_far(passing_[row].turn);
    turns_so_far.fetch_add(1);
    turns_so_far.notify_all();
  }
}

// ---- impulses

// Ends with friction: where surfaces close to a wedge within their friction cones, no impulses satisfy both,
// and the body is to stick, not to shoot out.
void ImpactSolver::solve_points(int max_sweeps, const Member& member) {
  // After the members' last barrier the caller may set that of the next generation.
  const float tolerance = tolerance_;
  solve_normals(kNormalSweeps, member);
  for (int sweep = 0; sweep < max_sweeps; ++sweep) {
    float greatest_change = 0.0F;
    for_each_point(sweep, member, [&](Point& p, const Visit& visit) {
      if (p.friction > 0.0F && p.seen_friction != versions(p))
        greatest_change = std::max(greatest_change, solve_friction(p, visit));
    });
    if (greatest_of_members(greatest_change, member) < tolerance || sweep + 1 == max_sweeps) break;
    solve_normals(kNormalSweepsPerFrictionSweep, member);
  }
}

void ImpactSolver::solve_normals(int max_sweeps, const Member& member) {
  for (int sweep = 0; sweep < max_sweeps; ++sweep) {
    bool any = false;
    for_each_point(sweep, member, [&](Point& p, const Visit& visit) {
      if (p.seen_normal == versions(p)) return;
      any = true;
      solve_normal(p, visit);
    });
    if (greatest_of_members(any ? 1.0F : 0.0F, member) == 0.0F) break;
  }
}

// Back and forth, so that no end of the list is favoured.
template <class Each>
void ImpactSolver::for_each_point(int sweep, const Member& member, Each each) {
  const bool is_backward = sweep % 2 != 0;
  const auto visit_in_order = [is_backward](std::size_t count, auto visit) {
    if (is_backward)
      for (std::size_t i = count; i-- > 0;) visit(i);
    else
      for (std::size_t i = 0; i < count; ++i) visit(i);
  };
  if (member.member_count == 1)
    return visit_in_order(points_.size(), [&](std::size_t i) { each(points_[i], Visit{nullptr, 0}); });
  MemberState& own = members_[member.index];
  visit_in_order(own.points.size(), [&](std::size_t i) {
    const OwnPoint& at = own.points[i];
    Point& p = own.copies[i];
    const auto place = static_cast<std::uint64_t>(is_backward ? points_.size() - 1 - at.index : at.index);
    if (at.is_shared) wait_for_turn(p, at, own.sweep, is_backward);
    each(p, Visit{&own, static_cast<std::uint64_t>(own.sweep) << 32U | place << 1U});
    if (at.is_shared) end_turn(p);
  });
}

// A number that changes whenever the velocity of one of the two bodies does.
std::uint32_t ImpactSolver::versions(const Point& p) const {
  return version_[p.row_a] + (p.row_b >= 0 ? version_[p.row_b] : 0);
}

void ImpactSolver::apply_impulse(Point& p, int axis, float impulse) {
  p.impulse[axis] += impulse;
  Vec(p.velocity_a->velocity) += impulse * p.velocity_a->inverse_mass * p.axis[axis];
  Vec(p.velocity_a->angular_velocity) += impulse * p.spin_a[axis];
  if (p.velocity_b == nullptr) return;
  Vec(p.velocity_b->velocity) += -impulse * p.velocity_b->inverse_mass * p.axis[axis];
  Vec(p.velocity_b->angular_velocity) += -impulse * p.spin_b[axis];
}

// Returns the change relative to the impulse of the whole impact.
float ImpactSolver::count_change(const Point& p, float impulse_change, const Visit& visit) {
  const float whole = p.normal_mass * p.blow_speed,
              change = whole > 0.0F ? std::abs(impulse_change) / whole : 0.0F;
  if (!(change > tolerance_)) return change;
  ++version_[p.row_a];
  if (p.row_b >= 0) ++version_[p.row_b];
  for (const std::int32_t body : {p.a, p.b}) {
    if (body < 0) continue;
    if (visit.state == nullptr) {
      mark_changed(body);
    } else if (!is_changed_[body]) {
      is_changed_[body] = 1;
      visit.state->changes.push_back({visit.order + (body == p.b ? 1 : 0), body});
    }
  }
  return change;
}

void ImpactSolver::solve_normal(Point& p, const Visit& visit) {
  const float wanted =
      law::normal_impulse(p.impulse[0], p.normal_mass, p.axis[0].dot(p.velocity()), p.target_speed);
  const float change = std::min(wanted, std::max(p.max_impulse, 0.0F)) - p.impulse[0];
  apply_impulse(p, 0, change);
  count_change(p, change, visit);
  p.seen_normal = versions(p);
}

float ImpactSolver::solve_friction(Point& p, const Visit& visit) {
  using Vec2 = Eigen::Vector2f;
  const Vec3 v = p.velocity();
  const Vec2 slip(p.axis[1].dot(v), p.axis[2].dot(v)), old_impulse = p.impulse.tail<2>();
  const float limit = p.friction * p.impulse[0], *const mass = p.tangent_mass;
  const Vec2 sticking =
      old_impulse - Vec2(mass[0] * slip.x() + mass[2] * slip.y(), mass[2] * slip.x() + mass[1] * slip.y());
  const Vec2 change =
      (sticking.norm() > limit ? law::friction_impulse(old_impulse, slip, p.slip_mass, limit) : sticking) -
      old_impulse;
  for (int i = 0; i < 2; ++i) apply_impulse(p, 1 + i, change[i]);
  const float relative_change = count_change(p, change.norm(), visit);
  p.seen_friction = versions(p);
  return relative_change;
}

// ---- energy

std::int32_t ImpactSolver::find_island(std::int32_t body) {
  auto parent = [this](std::int32_t i) -> std::int32_t& { return island_[i]; };
  while (parent(body) != body) body = parent(body) = parent(parent(body));
  return body;
}

// Newton's law with friction may add energy to bodies that are hit off-centre. Scales the impulses of each
// island down to where they do not.
void ImpactSolver::limit_energy() {
  for (const Point& p : points_)
    for (const std::int32_t body : {p.a, p.b})
      if (body >= 0) {
        island_[body] = body;
        energy_[body] = {};
      }
  for (const Point& p : points_) {
    if (p.b < 0 || p.velocity_a->inverse_mass == 0.0F || p.velocity_b->inverse_mass == 0.0F) continue;
    const std::int32_t a = find_island(p.a), b = find_island(p.b);
    island_[std::max(a, b)] = std::min(a, b);
  }
  auto energy_of = [this](const Point& p) -> IslandEnergy& {
    const bool a_moves = p.velocity_a->inverse_mass > 0.0F;
    return energy_[find_island(a_moves || p.b < 0 ? p.a : p.b)];
  };
  for (const Point& p : points_) {
    const Vec3 v = p.velocity();
    const Vec3 after(p.axis[0].dot(v), p.axis[1].dot(v), p.axis[2].dot(v));
    IslandEnergy& energy = energy_of(p);
    energy.linear += p.impulse.dot(p.velocity_before);
    energy.quadratic += p.impulse.dot(after - p.velocity_before);
    energy.budget += p.energy_budget;
  }
  constexpr float kRoundingError = 1e-4F;
  for (Point& p : points_) {
    const auto [linear, quadratic, budget] = energy_of(p);
    if (linear + 0.5F * quadratic <= budget + kRoundingError * std::abs(linear) || !(quadratic > 0.0F))
      continue;
    const float scale = std::clamp(
        (-linear + std::sqrt(linear * linear + 2.0F * quadratic * budget)) / quadratic, 0.0F, 1.0F);
    for (int axis = 0; axis < 3; ++axis) apply_impulse(p, axis, (scale - 1.0F) * p.impulse[axis]);
  }
}

}  // namespace smartsurf::world
