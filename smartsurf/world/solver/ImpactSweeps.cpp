// The impulses of the points of a generation: sweeps over the points, shared by the team, and the limit of
// their energy.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>
#include <utility>

#include "common/index/UnionFind.h"
#include "common/memory/Prefetch.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/ImpactSolver.h"

namespace smartsurf::world {
namespace {

constexpr int kNormalSweeps = 32, kNormalSweepsPerFrictionSweep = 4;
// Sweeps stay on one thread where fewer points lie outside the greatest island, and fewer per member within.
constexpr std::size_t kMinSharedPoints = 96;
constexpr std::int32_t kMinPointsPerMember = 64;
constexpr std::int32_t kMinGreatIsland = 128;  // in points

constexpr int kPrefetchDistance = 4;  // in points

using common::find_root;

}  // namespace

// ---- islands

void ImpactSolver::run_sweeps(Task task, const Step& step, const Member& member, int max_sweeps) {
  max_sweeps_ = max_sweeps;
  find_islands(step.partition);
  const auto greatest = static_cast<std::size_t>(std::ranges::max(islands_, {}, &Island::count).count);
  const bool shares =
      member.member_count > 1 && (points_.size() - greatest >= kMinSharedPoints ||
                                  static_cast<int>(greatest) >= kMinPointsPerMember * member.member_count);
  least_friction_sweeps_ = 0;
  do {
    group_islands(shares ? member.member_count : 1);
    run(task, step, member, shares);
  } while (continue_islands());
  take_changes();
}

void ImpactSolver::find_islands(const SpatialPartition& partition) {
  for (; joined_points_ < points_.size(); ++joined_points_) {
    const Point& p = points_[joined_points_];
    for_each_body(p, [&](std::int32_t, std::int32_t row) {
      if (root_[row] < 0) root_[row] = row;
      root_[find_root(root_, row)] = find_root(root_, p.row_a);
    });
  }
  islands_.clear();
  key_of_point_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    key_of_point_[i] = find_root(root_, points_[i].row_a);
    island_of_root_[key_of_point_[i]] = -1;
  }
  for (std::int32_t& key : key_of_point_) {
    const std::int32_t root = key;
    std::int32_t& island = island_of_root_[root];
    if (island < 0) {
      island = static_cast<std::int32_t>(islands_.size());
      islands_.push_back({root});
    }
    ++islands_[island].count;
    key = island;
  }
  std::int32_t first = 0;
  for (Island& island : islands_) island.first = first, first += std::exchange(island.count, 0);
  order_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Island& island = islands_[key_of_point_[i]];
    order_[island.first + island.count++] = static_cast<std::int32_t>(i);
  }
  bounds_.clear();
  for (Island& island : islands_)
    if (island.count >= kMinGreatIsland) order_by_slab(island, partition);
}

// Sorts the points of a great island by phase and slab, and cuts each phase into parts for the members, of
// about as many points.
void ImpactSolver::order_by_slab(Island& island, const SpatialPartition& partition) {
  const int slabs = partition.slab_count();
  const auto key_of = [&](std::int32_t point) {
    const Point& p = points_[point];
    const int a = slab_of_row_[p.row_a], b = p.row_b < 0 ? a : slab_of_row_[p.row_b], slab = std::min(a, b);
    const Phase phase = p.response_count > 0    ? kElsewhere
                        : a == b                ? kWithinSlabs
                        : a + b != 2 * slab + 1 ? kElsewhere
                        : slab % 2 == 0         ? kAfterEvenSlabs
                                                : kAfterOddSlabs;
    return phase * slabs + slab;
  };
  const std::span points(order_.data() + island.first, static_cast<std::size_t>(island.count));
  first_in_slab_.assign(kPhases * slabs + 1, 0);
  for (const std::int32_t point : points) {
    key_of_point_[point] = key_of(point);
    ++first_in_slab_[key_of_point_[point] + 1];
  }
  first_in_slab_[0] = island.first;
  for (int i = 0; i < kPhases * slabs; ++i) first_in_slab_[i + 1] += first_in_slab_[i];

  // A member takes the same slabs in each phase, whose bodies stay in its cache.
  const auto firsts_of = [&](int phase) {
    return std::span(first_in_slab_).subspan(phase * slabs, slabs + 1);
  };
  const auto members = static_cast<std::int32_t>(members_.size());
  island.first_bound = static_cast<std::int32_t>(bounds_.size());
  bounds_.resize(bounds_.size() + kPhases * (members + 1));
  std::int32_t slab = 0, before = 0;  // points in the slabs before
  const auto points_in = [&](std::int32_t of) {
    std::int32_t count = 0;
    for (int phase = 0; phase < kPhases; ++phase) count += firsts_of(phase)[of + 1] - firsts_of(phase)[of];
    return count;
  };
  for (std::int32_t m = 0; m <= members; ++m) {
    for (; slab < slabs; ++slab) {
      const std::int32_t own = points_in(slab);
      if (m < members && before + own / 2 >= island.count * m / members) break;
      before += own;
    }
    for (int phase = 0; phase < kPhases; ++phase)
      bounds_[island.first_bound + phase * (members + 1) + m] =
          phase == kElsewhere && m > 0 ? firsts_of(phase).back() : firsts_of(phase)[slab];
  }
  unordered_.assign(points.begin(), points.end());
  for (const std::int32_t point : unordered_) order_[first_in_slab_[key_of_point_[point]]++] = point;
}

// Islands that the team shares come first, then those with more than a member's share, the others in the
// order of the rows: what members write at the same time lies apart.
void ImpactSolver::group_islands(int member_count) {
  constexpr int kChunksPerMember = 4;
  chunks_.clear();
  shared_islands_ = lone_islands_ = 0;
  if (member_count == 1) {
    chunks_.push_back({0, islands_.size()});
    return;
  }
  std::int32_t points = 0;
  const auto is_shared = [&](const Island& island) {
    return island.first_bound >= 0 && island.count >= kMinPointsPerMember * member_count;
  };
  for (const Island& island : islands_)
    if (!is_shared(island)) points += island.count;
  const auto rank_of = [&](const Island& island) {
    return is_shared(island) ? 0 : island.count > points / member_count ? 1 : 2;
  };
  std::ranges::sort(islands_, {},
                    [&](const Island& island) { return std::pair(rank_of(island), island.root); });
  const auto first_of = [&](int rank) {
    return std::ranges::lower_bound(islands_, rank, {}, rank_of) - islands_.begin();
  };
  shared_islands_ = first_of(1);
  lone_islands_ = first_of(2) - shared_islands_;
  std::int32_t in_chunk = 0;
  for (std::size_t i = shared_islands_; i < islands_.size(); ++i) {
    if (in_chunk == 0) chunks_.push_back({i, i});
    ++chunks_.back().end;
    in_chunk += islands_[i].count;
    if (chunks_.size() <= lone_islands_ || in_chunk * kChunksPerMember * member_count >= points) in_chunk = 0;
  }
}

// The team sweeps over the shared islands together. Then members claim the lone islands and then chunks, each
// from its share on, so that a body stays in the cache of a core.
void ImpactSolver::sweep_islands(const Member& member) {
  MemberState& state = members_[member.index];
  for (std::size_t i = 0; i < shared_islands_; ++i) sweep_island(islands_[i], {state, &member});
  const auto claim = [&](Chunk& chunk) {
    if (std::atomic_ref(chunk.is_claimed).exchange(1, std::memory_order_relaxed) != 0) return;
    for (std::size_t i = chunk.first; i < chunk.end; ++i) sweep_island(islands_[i], {state});
  };
  const std::span lone(chunks_.data(), lone_islands_), others = std::span(chunks_).subspan(lone_islands_);
  for (Chunk& chunk : lone) claim(chunk);
  const std::size_t begin = others.size() * member.index / member.member_count;
  for (std::size_t k = begin; k < others.size(); ++k) claim(others[k]);
  for (std::size_t k = 0; k < begin; ++k) claim(others[k]);
}

void ImpactSolver::sweep_island(Island& island, Sweeper by) {
  if (task_ == Task::kSolveNormals)
    solve_normals(island, by, max_sweeps_, 0);
  else if (!island.is_settled &&
           (island.friction_sweeps == 0 || island.friction_sweeps < least_friction_sweeps_))
    solve_points(island, by);
}

// Sweeps over the whole list go on while a point of any island changes. Returns whether islands are left that
// such a sweep would change.
bool ImpactSolver::continue_islands() {
  if (task_ == Task::kSolveNormals) return false;
  for (const Island& island : islands_)
    least_friction_sweeps_ = std::max(least_friction_sweeps_, island.friction_sweeps);
  return std::ranges::any_of(islands_, [this](const Island& island) {
    return !island.is_settled && island.friction_sweeps < least_friction_sweeps_;
  });
}

// The bodies changed by the sweeps, in the order in which a serial sweep would change them.
void ImpactSolver::take_changes() {
  changes_.clear();
  for (MemberState& m : members_) {
    changes_.insert(changes_.end(), m.changes.begin(), m.changes.end());
    m.changes.clear();
  }
  std::ranges::sort(changes_);
  for (const Change& c : changes_) changed_bodies_.push_back(c.body);
}

// ---- impulses

[[gnu::always_inline]] inline void ImpactSolver::apply_impulse(Point& p, int axis, float impulse) {
  // The last components of the rows, the inverse mass and inertia, stay: those of the vectors are 0.
  const auto change = [&](BodyVelocity& v, float by, const Float4& spin) {
    store4(load4(v.velocity) + by * v.inverse_mass * p.axis[axis], v.velocity);
    store4(load4(v.angular_velocity) + by * spin, v.angular_velocity);
  };
  p.impulse[axis] += impulse;
  if (p.response_count > 0) [[unlikely]]
    return move_mechanisms(p, axis, impulse);
  change(*p.velocity_a, impulse, p.spin_a[axis]);
  if (p.velocity_b != nullptr) change(*p.velocity_b, -impulse, p.spin_b[axis]);
}

// The bodies of a point of which a side has joints, and all that joints connect with them.
[[gnu::noinline]] void ImpactSolver::move_mechanisms(const Point& p, int axis, float impulse) {
  for (const Response& r : responses_of(p)) {
    store4(load4(r.velocity->velocity) + impulse * r.linear[axis], r.velocity->velocity);
    store4(load4(r.velocity->angular_velocity) + impulse * r.spin[axis], r.velocity->angular_velocity);
  }
}

// Returns the change relative to the impulse of the whole impact.
[[gnu::always_inline]] inline float ImpactSolver::count_change(const Point& p, float impulse_change,
                                                               const Visit& visit) {
  const float whole = p.normal_mass * p.blow_speed,
              change = whole > 0.0F ? std::abs(impulse_change) / whole : 0.0F;
  if (!(change > tolerance_)) return change;
  const auto note = [&](RowState& state, std::int32_t body, std::uint64_t side) {
    ++state.version;
    if (!state.is_changed) visit.changes.push_back({visit.order(side), body});
    state.is_changed = true;
  };
  if (p.response_count > 0) [[unlikely]] {
    for (const Response& r : responses_of(p)) note(*r.state, r.body, 0);
    return change;
  }
  note(*p.state_a, p.a, 0);
  if (p.state_b != nullptr) note(*p.state_b, p.b, 1);
  return change;
}

// Ends with friction: where surfaces close to a wedge within their friction cones, no impulses satisfy both,
// and the body is to stick, not to shoot out.
void ImpactSolver::solve_points(Island& island, Sweeper& by) {
  constexpr int kSweepsPerFrictionSweep = 1 + kNormalSweepsPerFrictionSweep;
  const auto number_of = [](int friction_sweep) {
    return kNormalSweeps + friction_sweep * kSweepsPerFrictionSweep;
  };
  for (int sweep_number = island.friction_sweeps;; ++sweep_number) {
    const bool are_solved = sweep_number == 0 ? solve_normals(island, by, kNormalSweeps, 0)
                                              : solve_normals(island, by, kNormalSweepsPerFrictionSweep,
                                                              number_of(sweep_number - 1) + 1);
    const float greatest_change =
        sweep(island, by, sweep_number % 2 != 0, number_of(sweep_number), [&](Point& p, const Visit& visit) {
          return p.friction > 0.0F && p.seen_friction != versions(p) ? solve_friction(p, visit) : 0.0F;
        });
    const bool is_settled = sweep_number + 1 == max_sweeps_ ||
                            (greatest_change < tolerance_ && (are_solved || normals_are_solved(island, by)));
    if (!is_settled && (greatest_change >= tolerance_ || sweep_number + 1 < least_friction_sweeps_)) continue;
    if (by.team != nullptr && !by.team->is_caller()) return;
    island.friction_sweeps = sweep_number + 1;
    island.is_settled = is_settled;
    return;
  }
}

// Returns true if it is known that another sweep would change nothing: a point alone is solved in one, and
// where no velocity changes by more than the tolerance, all points have seen the others.
bool ImpactSolver::solve_normals(const Island& island, Sweeper& by, int max_sweeps, int first_number) {
  for (int number = 0; number < max_sweeps; ++number) {
    const float greatest_change =
        sweep(island, by, number % 2 != 0, first_number + number, [&](Point& p, const Visit& visit) {
          return p.seen_normal != versions(p) ? solve_normal(p, visit) : 0.0F;
        });
    if (!(greatest_change > tolerance_) || island.count == 1) return true;
  }
  return false;
}

// True if no velocity has changed since each normal was solved.
bool ImpactSolver::normals_are_solved(const Island& island, Sweeper& by) {
  return sweep(island, by, false, 0, [](const Point& p, const Visit&) {
           return p.seen_normal == versions(p) ? 0.0F : 1.0F;
         }) == 0.0F;
}

// Another member may have written them last.
void ImpactSolver::prefetch(const Point& p) {
  common::prefetch_to_write(p.velocity_a), common::prefetch_to_write(p.state_a);
  if (p.velocity_b == nullptr) return;
  common::prefetch_to_write(p.velocity_b), common::prefetch_to_write(p.state_b);
}

// Back and forth, so that no end of the list is favoured. `number`: of the sweep, since the first over these
// points. Returns the greatest that each() returns for any point, on all members that sweep.
template <class Each>
float ImpactSolver::sweep(const Island& island, Sweeper& by, bool is_backward, int number, Each each) {
  float greatest = 0.0F;
  const bool prefetches = members_.size() > 1;
  const auto visit = [&](std::int32_t begin, std::int32_t end) {
    const auto point = [&](std::int32_t k) { return order_[is_backward ? end - 1 - k : begin + k]; };
    for (std::int32_t k = 0; k < end - begin; ++k) {
      if (prefetches && k + kPrefetchDistance < end - begin) prefetch(points_[point(k + kPrefetchDistance)]);
      const std::size_t i = point(k);
      const Visit v{by.state.changes, number, is_backward ? points_.size() - 1 - i : i};
      greatest = std::max(greatest, each(points_[i], v));
    }
  };
  if (by.team == nullptr) {
    visit(island.first, island.first + island.count);
    return greatest;
  }
  by.is_odd = !by.is_odd;
  for (int i = 0; i < kPhases; ++i) {
    const auto members = members_.size();
    const int phase = is_backward ? kPhases - 1 - i : i;
    const std::span bounds =
        std::span(bounds_).subspan(island.first_bound + phase * (members + 1), members + 1);
    if (bounds.front() == bounds.back()) continue;
    visit(bounds[by.team->index], bounds[by.team->index + 1]);
    by.state.greatest_change[by.is_odd] = greatest;
    by.team->arrive_and_wait();
  }
  for (const MemberState& m : members_) greatest = std::max(greatest, m.greatest_change[by.is_odd]);
  return greatest;
}

float ImpactSolver::solve_normal(Point& p, const Visit& visit) {
  const float wanted = law::normal_impulse(p.impulse[0], p.normal_mass, p.normal_speed(), p.target_speed);
  const float change = std::min(wanted, std::max(p.max_impulse, 0.0F)) - p.impulse[0];
  apply_impulse(p, 0, change);
  const float relative_change = count_change(p, change, visit);
  p.seen_normal = versions(p);
  return relative_change;
}

float ImpactSolver::solve_friction(Point& p, const Visit& visit) {
  using Vec2 = Eigen::Vector2f;
  const Float4 v = p.velocity();
  const Vec2 slip(dot(p.axis[1], v), dot(p.axis[2], v)), old_impulse = p.impulse.tail<2>();
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
  const auto unite = [this](std::int32_t i, std::int32_t j) {
    const std::int32_t a = find_root(island_, i), b = find_root(island_, j);
    island_[std::max(a, b)] = std::min(a, b);
  };
  for (const Point& p : points_)
    for_each_body(p, [this](std::int32_t body, std::int32_t) {
      island_[body] = body;
      energy_[body] = {};
    });
  for (const Point& p : points_) {
    const std::span<const Response> responses = responses_of(p);
    for (const Response& r : responses) unite(r.body, responses.front().body);
    if (p.b >= 0 && p.velocity_a->inverse_mass > 0.0F && p.velocity_b->inverse_mass > 0.0F) unite(p.a, p.b);
  }
  auto energy_of = [this](const Point& p) -> IslandEnergy& {
    const bool a_moves = p.velocity_a->inverse_mass > 0.0F;
    return energy_[find_root(island_, a_moves || p.b < 0 ? p.a : p.b)];
  };
  for (const Point& p : points_) {
    const Vec3 after = p.velocity_along_axes();
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
