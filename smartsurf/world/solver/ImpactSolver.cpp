#include "smartsurf/world/solver/ImpactSolver.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "smartsurf/world/contact/ContactMaterial.h"
#include "smartsurf/world/narrowphase/PairContacts.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/SpeedLimits.h"

namespace smartsurf::world {
namespace {

constexpr float kMinOverlap = 1e-6F;  // rounding errors of a position, u
// A sphere hits two static surfaces at once if this far from the second when it hits the first, u.
constexpr float kSameInstant = 1e-4F;
constexpr int kMaxSetBackPasses = 4;
// A blow ends after this many generations, but while bodies rebound not before this many points: a light body
// between heavy ones goes back and forth a hundred times.
constexpr int kMinGenerations = 16;
constexpr std::size_t kMinBlowPoints = 4096;
constexpr int kMaxResistingPasses = 16, kNormalSweepsPerPass = 8;
// A contact without restitution resists a blow if it approaches at this share of the speed of the blow.
constexpr float kResistingShare = 0.02F;
constexpr int kMaxElasticStaticHits = 4;  // of a body and its static contacts in one step, after the first
// Sweeps over friction. Few points are solved more exactly than the hundreds that a blow to a pile may reach.
constexpr int kMinFrictionSweeps = 12, kMaxFrictionSweeps = 100;
int sweeps_of(std::size_t points) {
  constexpr std::size_t kPointSweeps = 3200;
  return static_cast<int>(
      std::clamp<std::size_t>(kPointSweeps / points, kMinFrictionSweeps, kMaxFrictionSweeps));
}
// Changes of an impulse that are worth another sweep, relative to that of the impact: in the first
// generation, and in those that follow.
constexpr float kFirstTolerance = 3e-5F, kTolerance = 1e-3F;

using Vec = Eigen::Map<Vec3>;
using ConstVec = Eigen::Map<const Vec3>;

float restitution_at(const ImpactSolver::Step& step, const Manifold& m, const Contact& c) {
  return restitution_of(step.bodies.surface_material[m.a],
                        material_of_b(step.bodies, step.field_material, m, c));
}

// The part of the step until a contact touches that has this separation at the end.
float fraction_until_touching(const Contact& c, float end) {
  const float start = std::max(c.separation, 0.0F);
  return start > 0.0F ? start / (start - end) : 0.0F;
}

// The impulse that a cell of limited force has left, on its motor's line, for one of the body's contacts.
float max_impulse_of(const ImpactSolver::Step& step, const Manifold& m, const Contact& c) {
  constexpr float kUnlimitedImpulse = std::numeric_limits<float>::infinity();
  const std::vector<Contact>& contacts = step.static_contacts.contacts;
  if (m.b >= 0 || step.cell_limits.empty()) return kUnlimitedImpulse;
  const CellImpulseLimit& limit = step.cell_limits[&c - contacts.data()];
  if (!limit.is_limited()) return kUnlimitedImpulse;
  const float capacity = (&limit + limit.to_first)->capacity;
  float load = 0.0F;
  int count = 0;
  for (int k = m.first; k < m.first + m.count; ++k) {
    if (!step.cell_limits[k].is_limited() || contacts[k].feature_id != c.feature_id) continue;
    load += contacts[k].total_normal_impulse * contacts[k].normal.z();
    ++count;
  }
  return std::max(0.0F, capacity - load) / (static_cast<float>(count) * c.normal.z());
}

// Normal speeds of an impact within the step.
struct Rebound {
  float contact_speed;  // at contact, > 0
  float end_speed;      // at the end of the step, `depth` below where the bodies touch
};

// The rebound leaves the bodies with e² times their energy at contact, wherever in the step that is, so that
// bounces neither gain nor lose energy by it. `approach_speed` and `speed_after` are the normal velocities
// before and after the substeps; both are exact half a substep earlier.
Rebound compute_rebound(float approach_speed, float speed_after, float separation, float depth,
                        float restitution, const ImpactSolver::Step& step) {
  constexpr float kMaxCorrection = 0.25F;
  const float acceleration = (speed_after - approach_speed) / step.dt_s;
  const float half_change = 0.5F * acceleration * step.dt_s / static_cast<float>(step.substeps);
  const float start = approach_speed + half_change, end = speed_after + half_change;
  const float least = std::min(std::abs(start), std::abs(end)),
              greatest = std::max(std::abs(start), std::abs(end));
  const float squared = start * start - 2.0F * acceleration * std::max(separation, 0.0F);
  const float contact = std::clamp(std::sqrt(std::max(squared, 0.0F)), least, greatest);
  const float rebound = law::rebound_speed(restitution, -contact), max_correction = kMaxCorrection * rebound;
  const float at_depth =
      depth > 0.0F ? std::sqrt(std::max(0.0F, rebound * rebound - 2.0F * acceleration * depth)) : rebound;
  return {contact, at_depth - std::clamp(half_change, -max_correction, max_correction)};
}

}  // namespace

ImpactSolver::Sides::Sides(const Step& step, const Manifold& m, const Contact& c)
    : surface_velocity(c.surface_velocity + 0.5F * step.dt_s * c.surface_acceleration) {
  const BodyStore& bodies = step.bodies;
  velocity_a = step.velocity + step.partition.row(m.a);
  delta_a = step.delta_pose + step.partition.row(m.a);
  // The solver's kernels take the anchors of spheres from their radii, too.
  anchor_a = bodies.is_sphere[m.a] ? Vec3(-bodies.bounding_radius[m.a] * c.normal) : c.anchor;
  if (m.b < 0) return;
  velocity_b = step.velocity + step.partition.row(m.b);
  delta_b = step.delta_pose + step.partition.row(m.b);
  anchor_b = bodies.is_sphere[m.b] ? Vec3(bodies.bounding_radius[m.b] * c.normal)
                                   : Vec3(bodies.position[m.a] + c.anchor - bodies.position[m.b] +
                                          c.anchor_time_s * (bodies.velocity(m.a) - bodies.velocity(m.b)));
}

Vec3 ImpactSolver::Sides::displacement_a() const { return displacement(*delta_a, anchor_a); }

Vec3 ImpactSolver::Sides::displacement_b(float dt_s) const {
  return delta_b == nullptr ? Vec3(dt_s * surface_velocity) : displacement(*delta_b, anchor_b);
}

// A point of a body that turns far stays on its arc: a straight path would lead it away from the body.
Vec3 ImpactSolver::Sides::displacement(const DeltaPose& delta, const Vec3& anchor) {
  constexpr float kFarTurn_rad = 0.25F;
  const ConstVec translation(delta.translation), rotation(delta.rotation);
  if (rotation.squaredNorm() < kFarTurn_rad * kFarTurn_rad) return translation + rotation.cross(anchor);
  return translation + rotation_from_vector(rotation) * anchor - anchor;
}

float ImpactSolver::Sides::separation(const Contact& c, float dt_s) const {
  return c.separation + c.normal.dot(displacement_a() - displacement_b(dt_s));
}

void ImpactSolver::reset(int member_count) {
  members_.resize(member_count);
  for (MemberState& m : members_) m.candidates.clear();
}

// Keeps the candidates that touch at the end of the step. Their order depends on the number of members; that
// of the hits does not.
void ImpactSolver::find_hits(const Step& step) {
  hits_.clear();
  for (const MemberState& m : members_)
    for (const Candidate& c : m.candidates) hits_.emplace_back(c);
  std::sort(hits_.begin(), hits_.end(), [](const Hit& a, const Hit& b) {
    return std::tuple(!a.is_pair, a.manifold, a.contact) < std::tuple(!b.is_pair, b.manifold, b.contact);
  });
  std::erase_if(hits_, [&](Hit& hit) {
    const ContactList& list = step.list(hit.is_pair);
    const Contact& c = list.contacts[hit.contact];
    if (hit.in_substeps) return c.total_normal_impulse <= 0.0F;
    const Manifold& m = list.manifolds[hit.manifold];
    if (hit.is_pair) return !meet(step, hit);
    const float end = Sides(step, m, c).separation(c, step.dt_s);
    if (end > 0.0F) return true;
    hit.fraction = fraction_until_touching(c, end);
    return false;
  });
  postpone_later_hits(step);
}

// A sphere that hits several static surfaces in the step, one after the other, may miss the later ones once
// it rebounds from the first: the first generation leaves them out.
void ImpactSolver::postpone_later_hits(const Step& step) {
  postponed_.clear();
  auto kept = hits_.begin();
  for (auto first = hits_.begin(), end = first; first != hits_.end(); first = end) {
    end = std::find_if(first, hits_.end(), [&](const Hit& hit) {
      return hit.is_pair != first->is_pair || hit.manifold != first->manifold;
    });
    const bool of_sphere =
        !first->is_pair && step.bodies.is_sphere[step.static_contacts.manifolds[first->manifold].a];
    float earliest = 1.0F;
    if (of_sphere && std::ranges::none_of(first, end, &Hit::in_substeps))
      earliest = std::ranges::min_element(first, end, {}, &Hit::fraction)->fraction;
    for (auto hit = first; hit != end; ++hit)
      if (!postpone(step, *hit, earliest)) *kept++ = *hit;
  }
  hits_.erase(kept, hits_.end());
}

// Returns false for a hit at the fraction `earliest` of the step, or at the same instant.
bool ImpactSolver::postpone(const Step& step, const Hit& hit, float earliest) {
  if (hit.fraction <= earliest) return false;
  const float start = step.static_contacts.contacts[hit.contact].separation,
              separation = start * (1.0F - earliest / hit.fraction);
  if (separation <= kSameInstant) return false;
  postponed_.resize(step.static_contacts.contacts.size());
  postponed_[hit.contact] = {separation, (1.0F - earliest) * step.dt_s};
  return true;
}

// Finds when and where the bodies of a pair meet. False: they do not. The path of spheres is that of their
// centres; other surfaces are planes meanwhile.
bool ImpactSolver::meet(const Step& step, Hit& hit) const {
  const ContactList& list = step.list(true);
  const Manifold& m = list.manifolds[hit.manifold];
  const Contact& c = list.contacts[hit.contact];
  const Sides s(step, m, c);
  const BodyStore& bodies = step.bodies;
  hit.normal = c.normal;
  const float start = std::max(c.separation, 0.0F), end = s.separation(c, step.dt_s);
  const Vec3 movement = ConstVec(s.delta_a->translation) - ConstVec(s.delta_b->translation);
  if (start > 0.0F && bodies.is_sphere[m.a] && bodies.is_sphere[m.b]) {
    const Vec3 distance = bodies.position[m.a] - bodies.position[m.b];
    const float radii = bodies.bounding_radius[m.a] + bodies.bounding_radius[m.b];
    hit.fraction = fraction_until_contact(distance, distance.norm() - radii, radii, movement);
    if (hit.fraction > 1.0F) return false;
    hit.normal = (distance + hit.fraction * movement).normalized();
  } else {
    if (end > 0.0F) return false;
    hit.fraction = fraction_until_touching(c, end);
  }
  hit.approach = hit.fraction * movement;
  return true;
}

void ImpactSolver::solve(const Step& step, const Member& member) {
  member.arrive_and_wait();
  if (member.is_caller()) {
    solve_on_caller(step, member);
    task_ = Task::kNone;
    member.arrive_and_wait();
    return;
  }
  for (;;) {
    member.arrive_and_wait();
    if (task_ == Task::kNone) return;
    work_on_task(step, member);
    member.arrive_and_wait();
  }
}

// On the caller: has the whole team work on a task, if `shares`.
void ImpactSolver::run(Task task, const Step& step, const Member& member, bool shares) {
  constexpr int kAlone = 1;
  task_ = task;
  if (!shares) return work_on_task(step, {0, kAlone, member.barrier});
  member.arrive_and_wait();
  work_on_task(step, member);
  member.arrive_and_wait();
}

void ImpactSolver::work_on_task(const Step& step, const Member& member) {
  MemberState& state = members_[member.index];
  if (task_ == Task::kFindApproaching)
    for_each_struck_manifold(step, [&](const ManifoldRef& m, std::vector<Point>& found) {
      find_approaching(step, m, state, found);
    });
  else if (task_ == Task::kFindResisting)
    for_each_struck_manifold(step, [&](const ManifoldRef& m, std::vector<Point>& found) {
      find_resisting(step, m, state, found);
    });
  else
    sweep_islands(member);
}

void ImpactSolver::solve_on_caller(const Step& step, const Member& member) {
  points_.clear();
  find_hits(step);
  if (hits_.empty()) return;
  for (const bool is_pair : {false, true}) is_point_[is_pair].assign(step.list(is_pair).contacts.size(), 0);
  index_manifolds(step);
  set_back_bodies(step);
  std::size_t blow_points = 0;
  is_last_ = false, rebounds_ = true;
  for (int generation = 0; !is_last_; ++generation) {
    clear_points(step);
    tolerance_ = generation == 0 ? kFirstTolerance : kTolerance;
    is_last_ = generation + 1 >= kMinGenerations && (!rebounds_ || blow_points >= kMinBlowPoints);
    rebounds_ = false;
    if (generation == 0)
      add_hits(step);
    else
      add_found_points(Task::kFindApproaching, step, member);
    if (points_.empty()) break;
    blow_points += points_.size();
    run_sweeps(Task::kSolvePoints, step, member, sweeps_of(points_.size()));
    moved_bodies_.clear();
    int pass = 0;
    for (; pass < kMaxResistingPasses && add_found_points(Task::kFindResisting, step, member); ++pass)
      run_sweeps(Task::kSolveNormals, step, member, kNormalSweepsPerPass);
    if (pass > 0) run_sweeps(Task::kSolvePoints, step, member, sweeps_of(points_.size()));
    for (const std::int32_t body : moved_bodies_) mark_changed(step, body);
    limit_energy();
    if (generation == 0) move_on(step);
    for (const Point& p : points_)
      if (p.stop < 0) p.contact->total_normal_impulse += p.impulse[0];
    if (!responses_.empty()) add_blows_to_joints(step);
  }
  forget_changed_bodies(step);
}

// ---- manifolds of moved bodies

void ImpactSolver::index_manifolds(const Step& step) {
  const std::size_t bodies = step.bodies.id.size(), pairs = step.pair_contacts.manifolds.size();
  first_pair_.assign(bodies, -1);
  static_manifold_.assign(bodies, -1);
  static_hits_.assign(bodies, 0);
  next_pair_.resize(2 * pairs);
  place_.resize(bodies);
  island_.resize(bodies);
  energy_.resize(bodies);
  root_.assign(step.partition.row_count(), -1);
  slab_of_row_.resize(step.partition.row_count());
  for (int slab = 0; slab < step.partition.slab_count(); ++slab) {
    const IndexRange rows = step.partition.rows_of(slab);
    std::fill(slab_of_row_.begin() + rows.begin, slab_of_row_.begin() + rows.end, slab);
  }
  if (const int rows = step.partition.row_count(); rows > 0) row_states_.resize(index_of_state(rows - 1) + 1);
  island_of_root_.resize(step.partition.row_count());
  blow_speed_.assign(bodies, 0.0F);
  is_active_pair_.assign(pairs, 0);
  for (std::size_t i = pairs; i-- > 0;) {
    const Manifold& m = step.pair_contacts.manifolds[i];
    const auto link = static_cast<std::int32_t>(2 * i);
    std::int32_t& first_a = first_pair_[m.a];
    next_pair_[2 * i] = first_a, first_a = link;
    std::int32_t& first_b = first_pair_[m.b];
    next_pair_[2 * i + 1] = first_b, first_b = link + 1;
  }
  for (std::size_t i = 0; i < step.static_contacts.manifolds.size(); ++i)
    static_manifold_[step.static_contacts.manifolds[i].a] = static_cast<std::int32_t>(i);
}

void ImpactSolver::mark_changed(const Step& step, std::int32_t body) {
  bool& is_changed = state_of_row(step.partition.row(body)).is_changed;
  if (!is_changed) changed_bodies_.push_back(body);
  is_changed = true;
}

void ImpactSolver::forget_changed_bodies(const Step& step) {
  for (const std::int32_t body : changed_bodies_) state_of_row(step.partition.row(body)).is_changed = false;
  changed_bodies_.clear();
}

// Moves on from the changed bodies to their manifolds.
void ImpactSolver::collect_active_manifolds(const Step& step) {
  active_.clear();
  for (const std::int32_t body : changed_bodies_) {
    state_of_row(step.partition.row(body)).is_changed = false;
    for (std::int32_t link = first_pair_[body]; link >= 0; link = next_pair_[link]) {
      char& is_active = is_active_pair_[link / 2];
      if (!is_active) active_.push_back({true, link / 2});
      is_active = 1;
    }
    if (static_manifold_[body] >= 0) active_.push_back({false, static_manifold_[body]});
  }
  changed_bodies_.clear();
  for (const ManifoldRef& m : active_)
    if (m.is_pair) is_active_pair_[m.index] = 0;
}

// ---- positions: bodies that passed through each other are set back to where they touch

void ImpactSolver::set_back_bodies(const Step& step) {
  for (Hit& hit : hits_) {
    if (hit.in_substeps) continue;
    const ContactList& list = step.list(hit.is_pair);
    set_back(step, list.manifolds[hit.manifold], list.contacts[hit.contact], kMinOverlap, &hit);
  }
  for (int pass = 0; pass < kMaxSetBackPasses && !changed_bodies_.empty(); ++pass) {
    collect_active_manifolds(step);
    for (const ManifoldRef& ref : active_) {
      const ContactList& list = step.list(ref.is_pair);
      const Manifold& m = list.manifolds[ref.index];
      for (int k = m.first; k < m.first + m.count; ++k)
        set_back(step, m, list.contacts[k], kTouchingSeparation);
    }
  }
  forget_changed_bodies(step);
}

// Bodies that meet in flight, with nothing else about them, are not set back: they move on with their new
// velocities from where they meet, which keeps their angular momentum.
void ImpactSolver::move_on(const Step& step) {
  for (std::size_t first = 0, end = 0; first < hits_.size(); first = end) {
    while (end < hits_.size() && hits_[end].is_pair == hits_[first].is_pair &&
           hits_[end].manifold == hits_[first].manifold)
      ++end;
    if (hits_[first].is_pair) move_pair_on(step, first, end);
  }
}

// The hits [first, end) are those of a pair, and so are the points.
void ImpactSolver::move_pair_on(const Step& step, std::size_t first, std::size_t end) {
  const Manifold& m = step.pair_contacts.manifolds[hits_[first].manifold];
  Vec3 by_a(0, 0, 0), by_b(0, 0, 0), turn_a(0, 0, 0), turn_b(0, 0, 0);
  for (std::size_t k = first; k < end; ++k) {
    const Hit& hit = hits_[k];
    if (hit.in_substeps) continue;
    const Point& p = points_[k];
    by_a -= hit.set_back_a, by_b -= hit.set_back_b;
    for (int i = 0; i < 3; ++i) {
      const float impulse_time = (1.0F - hit.fraction) * step.dt_s * p.impulse[i];
      const Vec3 axis = from_row(p.axis[i]);
      by_a += impulse_time * p.velocity_a->inverse_mass * axis;
      by_b -= impulse_time * p.velocity_b->inverse_mass * axis;
      turn_a += impulse_time * from_row(p.spin_a[i]), turn_b -= impulse_time * from_row(p.spin_b[i]);
    }
  }
  const auto is_free = [&](std::int32_t body, std::int32_t other, const Vec3& by) {
    const int row = step.partition.row(body);
    return step.velocity[row].inverse_mass > 0.0F && !step.bodies.is_jointed[body] &&
           step.has_room(body, other, ConstVec(step.delta_pose[row].translation).norm() + by.norm());
  };
  if (!is_free(m.a, m.b, by_a) || !is_free(m.b, m.a, by_b)) return;
  const auto move = [&](std::int32_t body, const Vec3& by, const Vec3& turn) {
    DeltaPose& delta = step.delta_pose[step.partition.row(body)];
    Vec(delta.translation) += by, Vec(delta.rotation) += turn;
  };
  move(m.a, by_a, turn_a), move(m.b, by_b, turn_b);
}

// Removes what the overlap has grown by in the step, if that exceeds `min_overlap`. Each body gives way by
// the share that it has in the approach. Not by mass: a body at rest stays where it is. Nor does one with
// joints give way, off which it would be; see NativeEngine::stop_jointed().
void ImpactSolver::set_back(const Step& step, const Manifold& m, const Contact& c, float min_overlap,
                            Hit* hit) {
  if (c.gives_way()) return;
  const auto moves = [&](std::int32_t body) {
    return step.velocity[step.partition.row(body)].inverse_mass > 0.0F && !step.bodies.is_jointed[body];
  };
  const bool moves_a = moves(m.a), moves_b = m.b >= 0 && moves(m.b);
  const Sides s(step, m, c);
  const float overlap = std::min(c.separation, 0.0F) - s.separation(c, step.dt_s);
  if (!(overlap > min_overlap)) return;
  float share_a = 1.0F;
  if (s.velocity_b != nullptr) {
    float a = std::max(-c.normal.dot(s.displacement_a()), 0.0F),
          b = std::max(c.normal.dot(s.displacement_b(step.dt_s)), 0.0F);
    if (!(a + b > 0.0F)) a = s.velocity_a->inverse_mass, b = s.velocity_b->inverse_mass;
    if (!moves_a) a = 0.0F;
    if (!moves_b) b = 0.0F;
    if (!(a + b > 0.0F)) return;
    share_a = a / (a + b);
    if (share_a < 1.0F) {
      const Vec3 change = -(1.0F - share_a) * overlap * c.normal;
      Vec(s.delta_b->translation) += change;
      if (hit != nullptr) hit->set_back_b += change;
      mark_changed(step, m.b);
    }
  }
  if (share_a > 0.0F && moves_a) {
    const Vec3 change = share_a * overlap * c.normal;
    Vec(s.delta_a->translation) += change;
    if (hit != nullptr) hit->set_back_a += change;
    mark_changed(step, m.a);
  }
}

// ---- the points of a generation

ImpactSolver::Point ImpactSolver::make_point(const Step& step, const Manifold& m, Contact& c) {
  return make_point(step, m, c, Sides(step, m, c), c.normal);
}

// The point at which the bodies of a hit meet.
ImpactSolver::Point ImpactSolver::make_meeting(const Step& step, const Hit& hit, const Manifold& m,
                                               Contact& c) {
  const BodyStore& bodies = step.bodies;
  Sides s(step, m, c);
  const Vec3 distance = bodies.position[m.a] - bodies.position[m.b] + hit.approach;
  const bool a_is_sphere = bodies.is_sphere[m.a], b_is_sphere = bodies.is_sphere[m.b];
  if (a_is_sphere)
    s.anchor_a = -bodies.bounding_radius[m.a] * hit.normal;
  else if (b_is_sphere)
    s.anchor_a = bodies.bounding_radius[m.b] * hit.normal - distance;
  else if (c.anchor_time_s == 0.0F)
    s.anchor_a -= 0.5F * (hit.approach - hit.normal.dot(hit.approach) * hit.normal);
  s.anchor_b = s.anchor_a + distance;
  return make_point(step, m, c, s, hit.normal);
}

ImpactSolver::Point ImpactSolver::make_point(const Step& step, const Manifold& m, Contact& c,
                                             const Sides& sides, const Vec3& normal) {
  Point p(sides);
  p.contact = &c;
  is_point(step, m.b >= 0, c) = 1;
  p.a = m.a, p.b = m.b;
  p.row_a = step.partition.row(m.a), p.row_b = m.b >= 0 ? step.partition.row(m.b) : -1;
  p.state_a = &state_of_row(p.row_a), p.state_b = m.b >= 0 ? &state_of_row(p.row_b) : nullptr;
  law::Vector3<float> t, u;
  law::tangents(to_law(normal), t, u);
  const Vec3 axis[3] = {normal, from_law(t), from_law(u)}, &anchor_a = sides.anchor_a,
             &anchor_b = sides.anchor_b;
  Vec3 spin_a[3], spin_b[3];
  const float inverse_mass = p.velocity_a->inverse_mass + (p.velocity_b ? p.velocity_b->inverse_mass : 0.0F);
  const InverseInertia& inertia_a = step.bodies.world_inverse_inertia[m.a];
  for (int i = 0; i < 3; ++i) spin_a[i] = multiply(inertia_a, anchor_a.cross(axis[i]));
  if (p.velocity_b != nullptr) {
    const InverseInertia& inertia_b = step.bodies.world_inverse_inertia[m.b];
    for (int i = 0; i < 3; ++i) spin_b[i] = multiply(inertia_b, anchor_b.cross(axis[i]));
  }
  auto inverse_effective_mass = [&](int i, int j) {
    float k = anchor_a.cross(axis[j]).dot(spin_a[i]) + (i == j ? inverse_mass : 0.0F);
    if (p.velocity_b != nullptr) k += anchor_b.cross(axis[j]).dot(spin_b[i]);
    return k;
  };
  for (int i = 0; i < 3; ++i) {
    p.axis[i] = to_row(axis[i]), p.spin_a[i] = to_row(spin_a[i]);
    if (p.velocity_b != nullptr) p.spin_b[i] = to_row(spin_b[i]);
  }
  set_masses(p, inverse_effective_mass(0, 0), inverse_effective_mass(1, 1), inverse_effective_mass(2, 2),
             inverse_effective_mass(1, 2));
  p.friction =
      friction_of(step.bodies.surface_material[m.a], material_of_b(step.bodies, step.field_material, m, c));
  p.max_impulse = max_impulse_of(step, m, c);
  p.velocity_before = p.velocity_along_axes();
  p.impulse = Vec3::Zero();
  p.energy_budget = 0.0F;
  p.seen_normal = p.seen_friction = versions(p) - 1;
  return p;
}

// From the inverse effective mass matrix.
void ImpactSolver::set_masses(Point& p, float nn, float tt, float uu, float tu) {
  p.normal_mass = law::inverse(nn);
  const float scale = law::inverse(tt * uu - tu * tu);
  p.tangent_mass[0] = uu * scale, p.tangent_mass[1] = tt * scale, p.tangent_mass[2] = -tu * scale;
  p.slip_mass = law::inverse(law::greatest_tangent_response(tt, uu, tu));
}

void ImpactSolver::add_hits(const Step& step) {
  for (const Hit& hit : hits_) {
    ContactList& list = hit.is_pair ? step.pair_contacts : step.static_contacts;
    const Manifold& m = list.manifolds[hit.manifold];
    Contact& c = list.contacts[hit.contact];
    const float restitution = restitution_at(step, m, c);
    Point p = hit.is_pair && !hit.in_substeps ? make_meeting(step, hit, m, c) : make_point(step, m, c);
    if (hit.in_substeps) {
      set_target(p, law::rebound_speed(restitution, hit.approach_speed), 0.0F);
      p.energy_budget = 0.5F * p.normal_mass * hit.approach_speed * hit.approach_speed;
      add_point(step, p);
      continue;
    }
    const float speed_after = p.velocity_before[0];
    float approach_speed = hit.approach_speed;
    if (hit.is_pair) {  // at the point where they meet
      const BodyStore& b = step.bodies;
      const Vec3 normal = from_row(p.axis[0]), anchor_a = from_row(p.anchor_a),
                 anchor_b = from_row(p.anchor_b);
      approach_speed = std::min(0.0F, normal.dot(b.velocity(m.a) + b.angular_velocity(m.a).cross(anchor_a) -
                                                 b.velocity(m.b) - b.angular_velocity(m.b).cross(anchor_b)));
    }
    // Bodies with joints are not set back.
    const bool is_jointed = step.bodies.is_jointed[m.a] || (m.b >= 0 && step.bodies.is_jointed[m.b]);
    const float depth = is_jointed ? std::max(0.0F, -Sides(step, m, c).separation(c, step.dt_s)) : 0.0F;
    const Rebound rebound =
        compute_rebound(approach_speed, speed_after, c.separation, depth, restitution, step);
    set_target(p, rebound.end_speed, 0.0F);
    // The rest of the impulse supports the body until the end of the step.
    const float change = rebound.end_speed - speed_after;
    if (change > 0.0F) p.friction *= std::min(1.0F, (1.0F + restitution) * rebound.contact_speed / change);
    add_point(step, p);
  }
}

// Adds the points that the task finds among the manifolds of the changed bodies, in the order of these.
// Returns whether there are any.
bool ImpactSolver::add_found_points(Task task, const Step& step, const Member& member) {
  constexpr std::size_t kMinSharedBodies = 16;
  constexpr int kChunksPerMember = 8;
  const std::size_t before = points_.size();
  take_changed_bodies(step);
  if (task == Task::kFindResisting) moved_bodies_.insert(moved_bodies_.end(), struck_.begin(), struck_.end());
  const bool shares = member.member_count > 1 && struck_.size() >= kMinSharedBodies;
  next_chunk_ = 0, chunk_count_ = shares ? kChunksPerMember * member.member_count : 1;
  if (std::ssize(found_) < chunk_count_) found_.resize(chunk_count_);
  run(task, step, member, shares);
  for (std::vector<Point>& found : found_) {
    std::ranges::for_each(found, [&](const Point& p) { add_point(step, p); });
    found.clear();
  }
  if (task == Task::kFindResisting && !step.joints.empty()) add_stops(step);
  for (MemberState& m : members_) rebounds_ |= std::exchange(m.rebounds, false);
  return points_.size() > before;
}

void ImpactSolver::take_changed_bodies(const Step& step) {
  struck_.swap(changed_bodies_);
  changed_bodies_.clear();
  for (std::size_t i = 0; i < struck_.size(); ++i) {
    place_[struck_[i]] = static_cast<std::int32_t>(i);
    state_of_row(step.partition.row(struck_[i])).is_changed = false;
  }
}

// Calls each(manifold, points found in the chunk) for the manifolds of the struck bodies in the chunks that
// the member claims; for those of two struck bodies only where the first of them is.
template <class Each>
void ImpactSolver::for_each_struck_manifold(const Step& step, Each each) {
  const Index bodies = std::ssize(struck_);
  for (int chunk;
       (chunk = std::atomic_ref(next_chunk_).fetch_add(1, std::memory_order_relaxed)) < chunk_count_;) {
    std::vector<Point>& found = found_[chunk];
    for (Index i = bodies * chunk / chunk_count_; i < bodies * (chunk + 1) / chunk_count_; ++i) {
      const std::int32_t body = struck_[i];
      for (std::int32_t link = first_pair_[body]; link >= 0; link = next_pair_[link]) {
        const Manifold& m = step.pair_contacts.manifolds[link / 2];
        const std::int32_t other = link % 2 == 0 ? m.b : m.a;
        const Index place = place_[other];
        const bool comes_first = place < i && struck_[place] == other;
        if (!comes_first) each(ManifoldRef{true, link / 2}, found);
      }
      if (static_manifold_[body] >= 0) each(ManifoldRef{false, static_manifold_[body]}, found);
    }
  }
}

// Finds the touching points of a manifold that approach, if any of them does so fast enough. Contacts without
// restitution resist instead: find_resisting().
void ImpactSolver::find_approaching(const Step& step, const ManifoldRef& ref, MemberState& state,
                                    std::vector<Point>& found) {
  ContactList& list = ref.is_pair ? step.pair_contacts : step.static_contacts;
  const Manifold& m = list.manifolds[ref.index];
  state.approaching.clear();
  float least = 0.0F;
  bool touches = false;
  for (int k = m.first; k < m.first + m.count; ++k) {
    Contact& c = list.contacts[k];
    const float restitution = restitution_at(step, m, c);
    if (restitution == 0.0F || c.gives_way()) continue;
    const Sides s(step, m, c);
    const float speed = c.normal.dot(s.velocity());
    if (speed >= 0.0F) continue;
    const float separation = s.separation(c, step.dt_s);
    if (separation > step.touching_separation(speed)) continue;
    if (!ref.is_pair && !postponed_.empty() && !postponed_[k].is_met_at(speed)) continue;
    touches |= separation <= kTouchingSeparation;
    least = std::min(least, speed);
    state.approaching.push_back({&c, law::rebound_speed(restitution, speed)});
  }
  if (!touches || least >= -kRestitutionThreshold) return;
  // A body that surfaces squeeze would bounce between them without end.
  const bool is_elastic = !is_last_ && (ref.is_pair || static_hits_[m.a]++ < kMaxElasticStaticHits);
  state.rebounds |= is_elastic;
  for (const Approaching& a : state.approaching)
    set_target(found.emplace_back(make_point(step, m, *a.contact)), is_elastic ? a.rebound_speed : 0.0F,
               0.0F);
}

// Finds the touching contacts without restitution that the blow has made approach: a body that rests on
// another is not struck as if it hung free.
void ImpactSolver::find_resisting(const Step& step, const ManifoldRef& ref, MemberState& state,
                                  std::vector<Point>& found) {
  ContactList& list = ref.is_pair ? step.pair_contacts : step.static_contacts;
  const Manifold& m = list.manifolds[ref.index];
  state.contacts.clear();
  bool approach = false, touches = false;
  const float blow_speed = std::max(blow_speed_[m.a], m.b >= 0 ? blow_speed_[m.b] : 0.0F);
  for (int k = m.first; k < m.first + m.count; ++k) {
    Contact& c = list.contacts[k];
    if (c.gives_way() || (!is_last_ && restitution_at(step, m, c) > 0.0F) || is_point(step, ref.is_pair, c))
      continue;
    const Sides s(step, m, c);
    const float speed = c.normal.dot(s.velocity()), separation = s.separation(c, step.dt_s);
    if (separation > step.touching_separation(speed)) continue;
    touches |= separation <= kTouchingSeparation;
    approach |= speed < -kResistingShare * blow_speed;
    state.contacts.push_back(&c);
  }
  if (!touches || !approach) return;
  for (Contact* c : state.contacts) set_target(found.emplace_back(make_point(step, m, *c)), 0.0F, blow_speed);
}

void ImpactSolver::set_target(Point& p, float speed, float blow_speed) {
  p.target_speed = speed;
  p.blow_speed = std::max(blow_speed, std::abs(speed) + std::abs(p.velocity_before[0]));
}

void ImpactSolver::add_point(const Step& step, const Point& point) {
  Point& p = points_.emplace_back(point);
  add_responses(step, p);
  for_each_body(p, [&](std::int32_t body, std::int32_t) {
    blow_speed_[body] = std::max(blow_speed_[body], p.blow_speed);
  });
}

// The contact's flag: nonzero if it is a point of the current generation.
char& ImpactSolver::is_point(const Step& step, bool is_pair, const Contact& c) {
  return is_point_[is_pair][&c - step.list(is_pair).contacts.data()];
}

void ImpactSolver::clear_points(const Step& step) {
  for (const Point& p : points_) {
    if (p.stop < 0) is_point(step, p.b >= 0, *p.contact) = 0;
    for_each_body(p, [this](std::int32_t, std::int32_t row) { root_[row] = -1; });
  }
  points_.clear();
  responses_.clear();
  stops_.clear();
  joined_points_ = 0;
}

}  // namespace smartsurf::world
