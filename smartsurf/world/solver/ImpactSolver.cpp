#include "smartsurf/world/solver/ImpactSolver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace smartsurf::world {
namespace {

constexpr float kTouchingSeparation = 1e-3F;  // contacts up to this take part in the impacts of others, u
constexpr float kMinOverlap = 1e-6F;          // rounding errors of a position, u
constexpr int kMaxGenerations = 16, kMaxSetBackPasses = 4;
constexpr int kMaxElasticStaticHits = 4;  // of a body and its static contacts in one step, after the first
constexpr int kNormalSweeps = 32, kFrictionSweeps = 12, kNormalSweepsPerFrictionSweep = 4;
// Changes of an impulse that are worth another sweep, relative to that of the impact: in the first generation, and in
// those that follow.
constexpr float kFirstTolerance = 3e-5F, kTolerance = 1e-3F;

Vec3 vec(const float (&v)[3]) { return {v[0], v[1], v[2]}; }
void add_to(float (&to)[3], const Vec3& v) {
  for (int i = 0; i < 3; ++i) to[i] += v[i];
}

Vec3 multiply(const InverseInertia& m, const Vec3& v) {
  return {m.xx * v.x() + m.xy * v.y() + m.xz * v.z(), m.xy * v.x() + m.yy * v.y() + m.yz * v.z(),
          m.xz * v.x() + m.yz * v.y() + m.zz * v.z()};
}

float length(float x, float y) { return std::sqrt(x * x + y * y); }

// Completes a unit vector to an orthonormal basis (Duff et al., Building an Orthonormal Basis, Revisited, 2017).
void compute_tangents(const Vec3& n, Vec3& t, Vec3& u) {
  const float sign = std::copysign(1.0F, n.z()), a = -1.0F / (sign + n.z()), b = n.x() * n.y() * a;
  t = {1.0F + sign * n.x() * n.x() * a, sign * b, -sign * n.x()};
  u = {b, sign + n.y() * n.y() * a, -n.y()};
}

// A contact in the state at the end of the substeps.
struct ContactState {
  BodyVelocity *velocity_a, *velocity_b;  // b: null if static
  DeltaPose *delta_a, *delta_b;
  Vec3 anchor_a, anchor_b;

  ContactState(const ImpactSolver::Step& step, const Manifold& m, const Contact& c) {
    const auto a = static_cast<std::size_t>(m.a);
    const std::int32_t row_a = step.partition.row(m.a);
    velocity_a = step.velocity + row_a;
    delta_a = step.delta_pose + row_a;
    // The solver's kernels take the anchors of spheres from their radii, too.
    anchor_a = step.bodies.is_sphere[a] ? Vec3(-step.bodies.bounding_radius[a] * c.normal) : c.anchor;
    velocity_b = nullptr;
    delta_b = nullptr;
    anchor_b = Vec3::Zero();
    if (m.b < 0) return;
    const auto b = static_cast<std::size_t>(m.b);
    const std::int32_t row_b = step.partition.row(m.b);
    velocity_b = step.velocity + row_b;
    delta_b = step.delta_pose + row_b;
    anchor_b = step.bodies.is_sphere[b] ? Vec3(step.bodies.bounding_radius[b] * c.normal)
                                        : Vec3(step.bodies.position[a] + c.anchor - step.bodies.position[b]);
  }

  Vec3 velocity(const Contact& c) const {
    Vec3 v = vec(velocity_a->velocity) + vec(velocity_a->angular_velocity).cross(anchor_a);
    if (velocity_b != nullptr)
      v -= vec(velocity_b->velocity) + vec(velocity_b->angular_velocity).cross(anchor_b);
    else
      v -= c.surface_velocity;
    return v;
  }
  Vec3 displacement_a() const { return vec(delta_a->translation) + vec(delta_a->rotation).cross(anchor_a); }
  Vec3 displacement_b(const Contact& c, float dt_s) const {
    if (delta_b == nullptr) return dt_s * c.surface_velocity;
    return vec(delta_b->translation) + vec(delta_b->rotation).cross(anchor_b);
  }
  float separation(const Contact& c, float dt_s) const {
    return c.separation + c.normal.dot(displacement_a() - displacement_b(c, dt_s));
  }
};

const SurfaceMaterial& material_of_b(const ImpactSolver::Step& step, const Manifold& m, const Contact& c) {
  const std::int32_t other = other_body(m, c);
  return other >= 0 ? step.bodies.surface_material[static_cast<std::size_t>(other)] : step.field_material;
}

float restitution_of(const ImpactSolver::Step& step, const Manifold& m, const Contact& c) {
  return std::max(step.bodies.surface_material[static_cast<std::size_t>(m.a)].restitution,
                  material_of_b(step, m, c).restitution);
}

// What a cell of limited force has left for one of the body's contacts with it.
float max_impulse_of(const ImpactSolver::Step& step, const Manifold& m, const Contact& c) {
  constexpr float kUnlimited = std::numeric_limits<float>::infinity();
  const std::vector<Contact>& contacts = step.static_contacts.contacts;
  if (m.b >= 0 || step.cell_limits.empty() ||
      !step.cell_limits[static_cast<std::size_t>(&c - contacts.data())].is_limited())
    return kUnlimited;
  float load = 0.0F;
  int count = 0;
  for (int k = m.first; k < m.first + m.count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (!step.cell_limits[i].is_limited() || contacts[i].feature_id != c.feature_id) continue;
    load += contacts[i].total_normal_impulse * contacts[i].normal.z();
    ++count;
  }
  return std::max(0.0F, c.max_cell_impulse - load) / (static_cast<float>(count) * c.normal.z());
}

// Normal speeds of an impact within the step.
struct Rebound {
  float contact_speed;  // at contact, > 0
  float end_speed;      // at the end of the step, set back to where the bodies touch
};

// The rebound leaves the bodies with e² times their energy at contact, wherever in the step that is, so that bounces
// neither gain nor lose energy by it. `approach_speed` and `speed_after` are the normal velocities before and after the
// substeps; both are exact half a substep earlier.
Rebound compute_rebound(float approach_speed, float speed_after, float separation, float restitution,
                        const ImpactSolver::Step& step) {
  constexpr float kMaxCorrection = 0.25F;
  const float acceleration = (speed_after - approach_speed) / step.dt_s;
  const float half_change = 0.5F * acceleration * step.dt_s / static_cast<float>(step.substeps);
  const float start = approach_speed + half_change, end = speed_after + half_change;
  const float least = std::min(std::abs(start), std::abs(end)),
              greatest = std::max(std::abs(start), std::abs(end));
  const float squared = start * start - 2.0F * acceleration * std::max(separation, 0.0F);
  const float contact = std::clamp(std::sqrt(std::max(squared, 0.0F)), least, greatest);
  const float rebound = restitution * contact, max_correction = kMaxCorrection * rebound;
  return {contact, rebound - std::clamp(half_change, -max_correction, max_correction)};
}

}  // namespace

void ImpactSolver::reset(int member_count) {
  candidates_.resize(static_cast<std::size_t>(member_count));
  for (Candidates& c : candidates_) c.list.clear();
}

// The order of candidates depends on the number of members; that of the result does not.
void ImpactSolver::merge_candidates() {
  hits_.clear();
  for (const Candidates& c : candidates_) hits_.insert(hits_.end(), c.list.begin(), c.list.end());
  std::sort(hits_.begin(), hits_.end(), [](const Candidate& a, const Candidate& b) {
    return std::tuple(!a.is_pair, a.contact) < std::tuple(!b.is_pair, b.contact);
  });
}

// Keeps the candidates that touch at the end of the step.
void ImpactSolver::find_hits(const Step& step) {
  merge_candidates();
  std::erase_if(hits_, [&](const Candidate& candidate) {
    const ContactList& list = step.list(candidate.is_pair);
    const Contact& c = list.contacts[static_cast<std::size_t>(candidate.contact)];
    if (candidate.in_substeps) return c.total_normal_impulse <= 0.0F;
    const Manifold& m = list.manifolds[static_cast<std::size_t>(candidate.manifold)];
    return ContactState(step, m, c).separation(c, step.dt_s) > 0.0F;
  });
}

void ImpactSolver::solve(const Step& step) {
  find_hits(step);
  if (hits_.empty()) return;
  index_manifolds(step);
  set_back_bodies(step);
  for (int generation = 0; generation < kMaxGenerations; ++generation) {
    points_.clear();
    tolerance_ = generation == 0 ? kFirstTolerance : kTolerance;
    if (generation == 0)
      add_hits(step);
    else
      for (const ManifoldRef& m : active_) add_approaching_points(step, m);
    if (points_.empty()) break;
    solve_points();
    limit_energy();
    store_impulses();
    collect_active_manifolds();
  }
}

// ---- manifolds of moved bodies

void ImpactSolver::index_manifolds(const Step& step) {
  const std::size_t bodies = step.bodies.id.size(), pairs = step.pair_contacts.manifolds.size();
  first_pair_.assign(bodies, -1);
  static_manifold_.assign(bodies, -1);
  static_hits_.assign(bodies, 0);
  next_pair_.resize(2 * pairs);
  version_.resize(bodies);
  island_.resize(bodies);
  energy_.resize(bodies);
  is_changed_.resize(bodies, 0);
  is_active_pair_.assign(pairs, 0);
  for (std::size_t i = pairs; i-- > 0;) {
    const Manifold& m = step.pair_contacts.manifolds[i];
    const auto link = static_cast<std::int32_t>(2 * i);
    std::int32_t& first_a = first_pair_[static_cast<std::size_t>(m.a)];
    next_pair_[2 * i] = first_a, first_a = link;
    std::int32_t& first_b = first_pair_[static_cast<std::size_t>(m.b)];
    next_pair_[2 * i + 1] = first_b, first_b = link + 1;
  }
  for (std::size_t i = 0; i < step.static_contacts.manifolds.size(); ++i)
    static_manifold_[static_cast<std::size_t>(step.static_contacts.manifolds[i].a)] =
        static_cast<std::int32_t>(i);
}

void ImpactSolver::mark_changed(std::int32_t body) {
  if (is_changed_[static_cast<std::size_t>(body)]) return;
  is_changed_[static_cast<std::size_t>(body)] = 1;
  changed_bodies_.push_back(body);
}

// Moves on from the changed bodies to their manifolds.
void ImpactSolver::collect_active_manifolds() {
  active_.clear();
  for (const std::int32_t body : changed_bodies_) {
    const auto i = static_cast<std::size_t>(body);
    is_changed_[i] = 0;
    for (std::int32_t link = first_pair_[i]; link >= 0; link = next_pair_[static_cast<std::size_t>(link)]) {
      char& is_active = is_active_pair_[static_cast<std::size_t>(link / 2)];
      if (!is_active) active_.push_back({true, link / 2});
      is_active = 1;
    }
    if (static_manifold_[i] >= 0) active_.push_back({false, static_manifold_[i]});
  }
  changed_bodies_.clear();
  for (const ManifoldRef& m : active_)
    if (m.is_pair) is_active_pair_[static_cast<std::size_t>(m.index)] = 0;
}

// ---- positions: bodies that passed through each other are set back to where they touch

void ImpactSolver::set_back_bodies(const Step& step) {
  for (const Candidate& hit : hits_) {
    if (hit.in_substeps) continue;
    const ContactList& list = step.list(hit.is_pair);
    set_back(step, list.manifolds[static_cast<std::size_t>(hit.manifold)],
             list.contacts[static_cast<std::size_t>(hit.contact)], kMinOverlap);
  }
  for (int pass = 0; pass < kMaxSetBackPasses && !changed_bodies_.empty(); ++pass) {
    collect_active_manifolds();
    for (const ManifoldRef& m : active_) set_back_manifold(step, m);
  }
  for (const std::int32_t body : changed_bodies_) is_changed_[static_cast<std::size_t>(body)] = 0;
  changed_bodies_.clear();
}

void ImpactSolver::set_back_manifold(const Step& step, const ManifoldRef& ref) {
  const ContactList& list = step.list(ref.is_pair);
  const Manifold& m = list.manifolds[static_cast<std::size_t>(ref.index)];
  for (int k = m.first; k < m.first + m.count; ++k)
    set_back(step, m, list.contacts[static_cast<std::size_t>(k)], kTouchingSeparation);
}

// Removes what the overlap has grown by in the step, if that exceeds `min_overlap`. Each body gives way by the share
// that it has in the approach. Not by mass: a body at rest stays where it is.
void ImpactSolver::set_back(const Step& step, const Manifold& m, const Contact& c, float min_overlap) {
  if (c.gives_way()) return;
  const ContactState s(step, m, c);
  const float overlap = std::min(c.separation, 0.0F) - s.separation(c, step.dt_s);
  if (!(overlap > min_overlap)) return;
  float share_a = 1.0F;
  if (s.velocity_b != nullptr) {
    float a = std::max(-c.normal.dot(s.displacement_a()), 0.0F),
          b = std::max(c.normal.dot(s.displacement_b(c, step.dt_s)), 0.0F);
    if (!(a + b > 0.0F)) a = s.velocity_a->inverse_mass, b = s.velocity_b->inverse_mass;
    if (s.velocity_a->inverse_mass == 0.0F) a = 0.0F;
    if (s.velocity_b->inverse_mass == 0.0F) b = 0.0F;
    if (!(a + b > 0.0F)) return;
    share_a = a / (a + b);
    if (share_a < 1.0F) {
      add_to(s.delta_b->translation, -(1.0F - share_a) * overlap * c.normal);
      mark_changed(m.b);
    }
  }
  if (share_a > 0.0F && s.velocity_a->inverse_mass > 0.0F) {
    add_to(s.delta_a->translation, share_a * overlap * c.normal);
    mark_changed(m.a);
  }
}

// ---- the points of a generation

ImpactSolver::Point& ImpactSolver::add_point(const Step& step, const Manifold& m, Contact& c) {
  const ContactState s(step, m, c);
  Point& p = points_.emplace_back();
  p.contact = &c;
  p.a = m.a, p.b = m.b;
  p.velocity_a = s.velocity_a, p.velocity_b = s.velocity_b;
  p.axis[0] = c.normal;
  compute_tangents(c.normal, p.axis[1], p.axis[2]);
  p.anchor_a = s.anchor_a, p.anchor_b = s.anchor_b;
  p.surface_velocity = c.surface_velocity;
  const float inverse_mass = s.velocity_a->inverse_mass + (s.velocity_b ? s.velocity_b->inverse_mass : 0.0F);
  const InverseInertia& inertia_a = step.bodies.world_inverse_inertia[static_cast<std::size_t>(m.a)];
  for (int i = 0; i < 3; ++i) p.spin_a[i] = multiply(inertia_a, p.anchor_a.cross(p.axis[i]));
  if (s.velocity_b != nullptr) {
    const InverseInertia& inertia_b = step.bodies.world_inverse_inertia[static_cast<std::size_t>(m.b)];
    for (int i = 0; i < 3; ++i) p.spin_b[i] = multiply(inertia_b, p.anchor_b.cross(p.axis[i]));
  }
  auto inverse_effective_mass = [&](int i, int j) {
    float k = p.anchor_a.cross(p.axis[j]).dot(p.spin_a[i]) + (i == j ? inverse_mass : 0.0F);
    if (s.velocity_b != nullptr) k += p.anchor_b.cross(p.axis[j]).dot(p.spin_b[i]);
    return k;
  };
  const float nn = inverse_effective_mass(0, 0), tt = inverse_effective_mass(1, 1),
              uu = inverse_effective_mass(2, 2), tu = inverse_effective_mass(1, 2),
              determinant = tt * uu - tu * tu;
  p.normal_mass = nn > 0.0F ? 1.0F / nn : 0.0F;
  const float scale = determinant > 0.0F ? 1.0F / determinant : 0.0F;
  p.tangent_mass[0] = uu * scale, p.tangent_mass[1] = tt * scale, p.tangent_mass[2] = -tu * scale;
  const float half = 0.5F * (tt - uu), greatest = 0.5F * (tt + uu) + std::sqrt(half * half + tu * tu);
  p.slip_mass = greatest > 0.0F ? 1.0F / greatest : 0.0F;
  p.friction = step.bodies.surface_material[static_cast<std::size_t>(m.a)].friction_root *
               material_of_b(step, m, c).friction_root;
  p.max_impulse = max_impulse_of(step, m, c);
  const Vec3 v = s.velocity(c);
  for (int i = 0; i < 3; ++i) p.velocity_before[i] = p.axis[i].dot(v);
  p.impulse = Vec3::Zero();
  p.energy_budget = 0.0F;
  p.seen_normal = p.seen_friction = versions(p) - 1;
  return p;
}

void ImpactSolver::add_hits(const Step& step) {
  for (const Candidate& hit : hits_) {
    ContactList& list = hit.is_pair ? step.pair_contacts : step.static_contacts;
    const Manifold& m = list.manifolds[static_cast<std::size_t>(hit.manifold)];
    Contact& c = list.contacts[static_cast<std::size_t>(hit.contact)];
    const float restitution = restitution_of(step, m, c);
    Point& p = add_point(step, m, c);
    if (hit.in_substeps) {
      p.target_speed = -restitution * hit.approach_speed;
      p.energy_budget = 0.5F * p.normal_mass * hit.approach_speed * hit.approach_speed;
      continue;
    }
    const float speed_after = p.velocity_before[0];
    const Rebound rebound = compute_rebound(hit.approach_speed, speed_after, c.separation, restitution, step);
    p.target_speed = rebound.end_speed;
    // The rest of the impulse supports the body until the end of the step.
    const float change = rebound.end_speed - speed_after;
    if (change > 0.0F) p.friction *= std::min(1.0F, (1.0F + restitution) * rebound.contact_speed / change);
  }
}

// Adds the touching points of a manifold that approach, if any of them does so fast enough. Contacts without restitution
// are left to the next step.
void ImpactSolver::add_approaching_points(const Step& step, const ManifoldRef& ref) {
  ContactList& list = ref.is_pair ? step.pair_contacts : step.static_contacts;
  const Manifold& m = list.manifolds[static_cast<std::size_t>(ref.index)];
  float least = 0.0F;
  for (int k = m.first; k < m.first + m.count; ++k) {
    Contact& c = list.contacts[static_cast<std::size_t>(k)];
    const float restitution = restitution_of(step, m, c);
    if (restitution == 0.0F || c.gives_way()) continue;
    const ContactState s(step, m, c);
    const float speed = c.normal.dot(s.velocity(c));
    if (speed >= 0.0F || s.separation(c, step.dt_s) > kTouchingSeparation) continue;
    least = std::min(least, speed);
    approaching_.push_back({&c, -restitution * speed});
  }
  if (least < -kThreshold) {
    // A body that surfaces squeeze would bounce between them without end.
    const bool is_elastic =
        ref.is_pair || static_hits_[static_cast<std::size_t>(m.a)]++ < kMaxElasticStaticHits;
    for (const Approaching& a : approaching_)
      add_point(step, m, *a.contact).target_speed = is_elastic ? a.rebound_speed : 0.0F;
  }
  approaching_.clear();
}

// ---- impulses

// Ends with friction: where surfaces close to a wedge within their friction cones, no impulses satisfy both, and the
// body is to stick, not to shoot out.
void ImpactSolver::solve_points() {
  solve_normals(kNormalSweeps);
  for (int sweep = 0; sweep < kFrictionSweeps; ++sweep) {
    float greatest_change = 0.0F;
    for_each_point(sweep, [&](Point& p) {
      if (p.friction > 0.0F && p.seen_friction != versions(p))
        greatest_change = std::max(greatest_change, solve_friction(p));
    });
    if (greatest_change < tolerance_ || sweep + 1 == kFrictionSweeps) break;
    solve_normals(kNormalSweepsPerFrictionSweep);
  }
}

void ImpactSolver::solve_normals(int max_sweeps) {
  for (int sweep = 0; sweep < max_sweeps; ++sweep) {
    bool any = false;
    for_each_point(sweep, [&](Point& p) {
      if (p.seen_normal == versions(p)) return;
      any = true;
      solve_normal(p);
    });
    if (!any) break;
  }
}

// Back and forth, so that no end of the list is favoured.
template <class Each>
void ImpactSolver::for_each_point(int sweep, Each each) {
  if (sweep % 2 == 0)
    std::for_each(points_.begin(), points_.end(), each);
  else
    std::for_each(points_.rbegin(), points_.rend(), each);
}

// A number that changes whenever the velocity of one of the two bodies does.
std::uint32_t ImpactSolver::versions(const Point& p) const {
  return version_[static_cast<std::size_t>(p.a)] + (p.b >= 0 ? version_[static_cast<std::size_t>(p.b)] : 0);
}

namespace {

Vec3 relative_velocity(const Vec3& surface_velocity, const BodyVelocity& a, const Vec3& anchor_a,
                       const BodyVelocity* b, const Vec3& anchor_b) {
  const Vec3 v = vec(a.velocity) + vec(a.angular_velocity).cross(anchor_a);
  if (b == nullptr) return v - surface_velocity;
  return v - (vec(b->velocity) + vec(b->angular_velocity).cross(anchor_b));
}

}  // namespace

void ImpactSolver::apply_impulse(Point& p, int axis, float impulse) {
  p.impulse[axis] += impulse;
  add_to(p.velocity_a->velocity, impulse * p.velocity_a->inverse_mass * p.axis[axis]);
  add_to(p.velocity_a->angular_velocity, impulse * p.spin_a[axis]);
  if (p.velocity_b == nullptr) return;
  add_to(p.velocity_b->velocity, -impulse * p.velocity_b->inverse_mass * p.axis[axis]);
  add_to(p.velocity_b->angular_velocity, -impulse * p.spin_b[axis]);
}

// Returns the change relative to the impulse of the whole impact.
float ImpactSolver::count_change(const Point& p, float impulse_change) {
  const float whole = p.normal_mass * (std::abs(p.target_speed) + std::abs(p.velocity_before[0])),
              change = whole > 0.0F ? std::abs(impulse_change) / whole : 0.0F;
  if (change > tolerance_)
    for (const std::int32_t body : {p.a, p.b})
      if (body >= 0) ++version_[static_cast<std::size_t>(body)], mark_changed(body);
  return change;
}

void ImpactSolver::solve_normal(Point& p) {
  const Vec3 v = relative_velocity(p.surface_velocity, *p.velocity_a, p.anchor_a, p.velocity_b, p.anchor_b);
  const float speed = p.axis[0].dot(v);
  const float impulse = std::clamp(p.impulse[0] + p.normal_mass * (p.target_speed - speed), 0.0F,
                                   std::max(p.max_impulse, 0.0F));
  const float change = impulse - p.impulse[0];
  apply_impulse(p, 0, change);
  count_change(p, change);
  p.seen_normal = versions(p);
}

float ImpactSolver::solve_friction(Point& p) {
  const Vec3 v = relative_velocity(p.surface_velocity, *p.velocity_a, p.anchor_a, p.velocity_b, p.anchor_b);
  const float t = p.axis[1].dot(v), u = p.axis[2].dot(v);
  const float limit = p.friction * p.impulse[0];
  // Sticks if the cone allows it.
  float next_t = p.impulse[1] - (p.tangent_mass[0] * t + p.tangent_mass[2] * u),
        next_u = p.impulse[2] - (p.tangent_mass[2] * t + p.tangent_mass[1] * u);
  if (length(next_t, next_u) > limit) {
    // Slides: with a scalar mass, the fixed point is a friction impulse exactly against the slip.
    next_t = p.impulse[1] - p.slip_mass * t, next_u = p.impulse[2] - p.slip_mass * u;
    const float unbounded = length(next_t, next_u);
    if (unbounded > limit) next_t *= limit / unbounded, next_u *= limit / unbounded;
  }
  const float change_t = next_t - p.impulse[1], change_u = next_u - p.impulse[2];
  apply_impulse(p, 1, change_t);
  apply_impulse(p, 2, change_u);
  const float change = count_change(p, length(change_t, change_u));
  p.seen_friction = versions(p);
  return change;
}

// ---- energy

std::int32_t ImpactSolver::find_island(std::int32_t body) {
  auto parent = [this](std::int32_t i) -> std::int32_t& { return island_[static_cast<std::size_t>(i)]; };
  while (parent(body) != body) body = parent(body) = parent(parent(body));
  return body;
}

// Newton's law with friction may add energy to bodies that are hit off-centre. Scales the impulses of each island down
// to where they do not.
void ImpactSolver::limit_energy() {
  for (const Point& p : points_)
    for (const std::int32_t body : {p.a, p.b})
      if (body >= 0) {
        island_[static_cast<std::size_t>(body)] = body;
        energy_[static_cast<std::size_t>(body)] = {};
      }
  for (const Point& p : points_) {
    if (p.b < 0 || p.velocity_a->inverse_mass == 0.0F || p.velocity_b->inverse_mass == 0.0F) continue;
    const std::int32_t a = find_island(p.a), b = find_island(p.b);
    island_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  }
  auto energy_of = [this](const Point& p) -> IslandEnergy& {
    const bool a_moves = p.velocity_a->inverse_mass > 0.0F;
    return energy_[static_cast<std::size_t>(find_island(a_moves || p.b < 0 ? p.a : p.b))];
  };
  for (const Point& p : points_) {
    const Vec3 v = relative_velocity(p.surface_velocity, *p.velocity_a, p.anchor_a, p.velocity_b, p.anchor_b);
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

void ImpactSolver::store_impulses() {
  for (const Point& p : points_) p.contact->total_normal_impulse += p.impulse[0];
}

}  // namespace smartsurf::world
