// The impulses of the points of a generation: sweeps over the points, shared by the team, and the limit of
// their energy.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>
#include <utility>

#include "common/index/UnionFind.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/ImpactSolver.h"

namespace smartsurf::world {
namespace {

constexpr int kNormalSweeps = 32, kNormalSweepsPerFrictionSweep = 4;
// Sweeps stay on one thread where fewer points lie outside the greatest island.
constexpr std::size_t kMinSharedPoints = 96;

using Vec = Eigen::Map<Vec3>;
using common::find_root;

}  // namespace

// ---- islands

void ImpactSolver::run_sweeps(const Member& member, Sweeps sweeps, int max_sweeps) {
  sweeps_ = sweeps, max_sweeps_ = max_sweeps;
  find_islands();
  const auto greatest = static_cast<std::size_t>(std::ranges::max(islands_, {}, &Island::count).count);
  const bool shares = member.member_count > 1 && points_.size() - greatest >= kMinSharedPoints;
  least_friction_sweeps_ = 0;
  do {
    group_islands(shares ? member.member_count : 1);
    if (shares) member.arrive_and_wait();
    sweep_islands(member);
    if (shares) member.arrive_and_wait();
  } while (continue_islands());
  take_changes();
}

void ImpactSolver::find_islands() {
  for (; joined_points_ < points_.size(); ++joined_points_) {
    const Point& p = points_[joined_points_];
    for (const std::int32_t row : {p.row_a, p.row_b})
      if (row >= 0 && root_[row] < 0) root_[row] = row;
    if (p.row_b >= 0) root_[find_root(root_, p.row_b)] = find_root(root_, p.row_a);
  }
  islands_.clear();
  for (const Point& p : points_) island_of_root_[find_root(root_, p.row_a)] = -1;
  for (const Point& p : points_) {
    const std::int32_t root = find_root(root_, p.row_a);
    std::int32_t& island = island_of_root_[root];
    if (island < 0) {
      island = static_cast<std::int32_t>(islands_.size());
      islands_.push_back({root});
    }
    ++islands_[island].count;
  }
  std::int32_t first = 0;
  for (Island& island : islands_) {
    island.first = first;
    first += island.count;
    island_of_root_[island.root] = island.first;  // from here on: where its next point goes
  }
  order_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i)
    order_[island_of_root_[find_root(root_, points_[i].row_a)]++] = static_cast<std::int32_t>(i);
}

// Islands with more than a member's share come first, the others in the order of the rows: what members write
// at the same time lies apart.
void ImpactSolver::group_islands(int member_count) {
  constexpr int kChunksPerMember = 4;
  chunks_.clear();
  if (member_count == 1) {
    chunks_.push_back({0, islands_.size()});
    great_islands_ = 0;
    return;
  }
  const auto points = static_cast<std::int32_t>(points_.size());
  const auto is_great = [&](const Island& island) { return island.count > points / member_count; };
  std::ranges::sort(islands_, {},
                    [&](const Island& island) { return std::pair(!is_great(island), island.root); });
  const auto others = std::ranges::find_if_not(islands_, is_great);
  great_islands_ = others - islands_.begin();
  for (std::size_t i = 0; i < great_islands_; ++i) chunks_.push_back({i, i + 1});
  std::int32_t in_chunk = 0;
  for (std::size_t i = great_islands_; i < islands_.size(); ++i) {
    if (in_chunk == 0) chunks_.push_back({i, i});
    ++chunks_.back().end;
    in_chunk += islands_[i].count;
    if (in_chunk * kChunksPerMember * member_count >= points) in_chunk = 0;
  }
}

// Members claim the great islands and then chunks, each from its share on, so that a body stays in the cache
// of a core.
void ImpactSolver::sweep_islands(const Member& member) {
  std::vector<Change>& changes = members_[member.index].changes;
  const auto claim = [&](Chunk& chunk) {
    if (std::atomic_ref(chunk.is_claimed).exchange(1, std::memory_order_relaxed) == 0)
      sweep_chunk(chunk, changes);
  };
  const std::span great(chunks_.data(), great_islands_), others = std::span(chunks_).subspan(great_islands_);
  for (Chunk& chunk : great) claim(chunk);
  const std::size_t begin = others.size() * member.index / member.member_count;
  for (std::size_t k = begin; k < others.size(); ++k) claim(others[k]);
  for (std::size_t k = 0; k < begin; ++k) claim(others[k]);
}

void ImpactSolver::sweep_chunk(const Chunk& chunk, std::vector<Change>& changes) {
  for (std::size_t i = chunk.first; i < chunk.end; ++i) {
    Island& island = islands_[i];
    if (sweeps_ == Sweeps::kNormals)
      solve_normals(island, max_sweeps_, 0, changes);
    else if (!island.is_settled &&
             (island.friction_sweeps == 0 || island.friction_sweeps < least_friction_sweeps_))
      solve_points(island, changes);
  }
}

// Sweeps over the whole list go on while a point of any island changes. Returns whether islands are left that
// such a sweep would change.
bool ImpactSolver::continue_islands() {
  if (sweeps_ == Sweeps::kNormals) return false;
  for (const Island& island : islands_)
    least_friction_sweeps_ = std::max(least_friction_sweeps_, island.friction_sweeps);
  return std::ranges::any_of(islands_, [this](const Island& island) {
    return !island.is_settled && island.friction_sweeps < least_friction_sweeps_;
  });
}

// The bodies that the sweeps have changed, in the order in which those over the list would have.
void ImpactSolver::take_changes() {
  changes_.clear();
  for (MemberState& m : members_) {
    changes_.insert(changes_.end(), m.changes.begin(), m.changes.end());
    m.changes.clear();
  }
  std::ranges::sort(changes_, {}, &Change::order);
  for (const Change& c : changes_) changed_bodies_.push_back(c.body);
}

// ---- impulses

[[gnu::always_inline]] inline void ImpactSolver::apply_impulse(Point& p, int axis, float impulse) {
  p.impulse[axis] += impulse;
  Vec(p.velocity_a->velocity) += impulse * p.velocity_a->inverse_mass * p.axis[axis];
  Vec(p.velocity_a->angular_velocity) += impulse * p.spin_a[axis];
  if (p.velocity_b == nullptr) return;
  Vec(p.velocity_b->velocity) += -impulse * p.velocity_b->inverse_mass * p.axis[axis];
  Vec(p.velocity_b->angular_velocity) += -impulse * p.spin_b[axis];
}

// Returns the change relative to the impulse of the whole impact.
[[gnu::always_inline]] inline float ImpactSolver::count_change(const Point& p, float impulse_change,
                                                               const Visit& visit) {
  const float whole = p.normal_mass * p.blow_speed,
              change = whole > 0.0F ? std::abs(impulse_change) / whole : 0.0F;
  if (!(change > tolerance_)) return change;
  ++version_[p.row_a];
  if (p.row_b >= 0) ++version_[p.row_b];
  for (const std::int32_t body : {p.a, p.b}) {
    if (body < 0) continue;
    if (is_changed_[body]) continue;
    is_changed_[body] = 1;
    visit.changes.push_back({visit.order + (body == p.b ? 1 : 0), body});
  }
  return change;
}

// Ends with friction: where surfaces close to a wedge within their friction cones, no impulses satisfy both,
// and the body is to stick, not to shoot out.
void ImpactSolver::solve_points(Island& island, std::vector<Change>& changes) {
  constexpr int kSweepsPerFrictionSweep = 1 + kNormalSweepsPerFrictionSweep;
  const auto number_of = [](int friction_sweep) {
    return kNormalSweeps + friction_sweep * kSweepsPerFrictionSweep;
  };
  if (island.friction_sweeps == 0) solve_normals(island, kNormalSweeps, 0, changes);
  for (int sweep = island.friction_sweeps;; ++sweep) {
    if (sweep > 0) solve_normals(island, kNormalSweepsPerFrictionSweep, number_of(sweep - 1) + 1, changes);
    float greatest_change = 0.0F;
    for_each_point(island, sweep % 2 != 0, number_of(sweep), changes, [&](Point& p, const Visit& visit) {
      if (p.friction > 0.0F && p.seen_friction != versions(p))
        greatest_change = std::max(greatest_change, solve_friction(p, visit));
    });
    island.friction_sweeps = sweep + 1;
    island.is_settled =
        sweep + 1 == max_sweeps_ || (greatest_change < tolerance_ && normals_are_solved(island));
    if (island.is_settled || (greatest_change < tolerance_ && sweep + 1 >= least_friction_sweeps_)) return;
  }
}

void ImpactSolver::solve_normals(const Island& island, int max_sweeps, int first_number,
                                 std::vector<Change>& changes) {
  bool any = true;
  for (int sweep = 0; any && sweep < max_sweeps; ++sweep) {
    any = false;
    for_each_point(island, sweep % 2 != 0, first_number + sweep, changes, [&](Point& p, const Visit& visit) {
      if (p.seen_normal == versions(p)) return;
      any = true;
      solve_normal(p, visit);
    });
  }
}

// True if no velocity has changed since each normal was solved.
bool ImpactSolver::normals_are_solved(const Island& island) const {
  const std::span points(order_.data() + island.first, static_cast<std::size_t>(island.count));
  return std::ranges::all_of(
      points, [this](std::int32_t i) { return points_[i].seen_normal == versions(points_[i]); });
}

// Back and forth, so that no end of the list is favoured. `number`: of the sweep, since the first over these
// points.
template <class Each>
void ImpactSolver::for_each_point(const Island& island, bool is_backward, int number,
                                  std::vector<Change>& changes, Each each) {
  for (std::int32_t k = 0; k < island.count; ++k) {
    const std::int32_t i = order_[is_backward ? island.first + island.count - 1 - k : island.first + k];
    const auto place = static_cast<std::uint64_t>(is_backward ? points_.size() - 1 - i : i);
    each(points_[i], Visit{changes, static_cast<std::uint64_t>(number) << 32U | place << 1U});
  }
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
    const std::int32_t a = find_root(island_, p.a), b = find_root(island_, p.b);
    island_[std::max(a, b)] = std::min(a, b);
  }
  auto energy_of = [this](const Point& p) -> IslandEnergy& {
    const bool a_moves = p.velocity_a->inverse_mass > 0.0F;
    return energy_[find_root(island_, a_moves || p.b < 0 ? p.a : p.b)];
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
