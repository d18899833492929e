#include "smartsurf/world/bullet/BulletEngine.h"

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>

#include "smartsurf/world/Substeps.h"
#include "smartsurf/world/bullet/BulletJoint.h"
#include "smartsurf/world/bullet/BulletShape.h"
#include "smartsurf/world/bullet/CellPool.h"
#include "smartsurf/world/bullet/ConeFrictionSolver.h"
#include "smartsurf/world/solver/SpeedLimits.h"

namespace smartsurf::world {
namespace {

constexpr int kIterations = 100;             // of the solver, per substep
constexpr double kConverged = 1e-8;          // most change of a contact's velocity in an iteration, pitches/s
constexpr double kMinTopNormalZ = 0.5;       // a contact with a smaller vertical part is with a cell's side
constexpr double kMinLimitedNormalZ = 0.05;  // a contact with a smaller vertical part does not load the cell
// A contact with a cell is with an edge if its normal is between these.
constexpr double kMinEdgeNormalZ = 1e-3, kMaxEdgeNormalZ = 0.999;
// In pitches. A gap up to the first counts as closed: its rounding errors, divided by a short step, would
// decide which cells bear a flat face. A body that is nowhere deeper below a cell's top than the second
// touches the top and not the side.
constexpr double kTouchingGap = 1e-4, kTopDepth = 5e-3;
constexpr double kCellMargin = 0.25;  // around a body's bounds, within which cells are in the world, pitches
// Yield speed of a column that is not overloaded.
constexpr double kHolds = -std::numeric_limits<double>::infinity();
// Compliance of a contact relative to the inverse of the lighter body's mass. It makes the loads on many
// cells under one rigid face definite: those of equal compliances.
constexpr double kRelativeCompliance = 1e-2;

struct SurfaceParameters {
  double friction = 0.0, rolling_friction = 0.0, restitution = 0.0;
};

SurfaceParameters parameters_of(const scene::Material& m) {
  return {m.friction, m.rolling_friction, m.restitution};
}

bool resists_rolling(scene::ShapeKind kind) {
  return kind != scene::ShapeKind::kBox && kind != scene::ShapeKind::kSolid;
}

// Bullet finds one point at a time for these, and needs those of earlier steps.
bool gathers_points(scene::ShapeKind kind) {
  return kind == scene::ShapeKind::kCylinder || kind == scene::ShapeKind::kCapsule ||
         kind == scene::ShapeKind::kCone;
}

struct Body {
  bool gathers_points;
  BulletShape shape;
  std::unique_ptr<btRigidBody> rigid;
  SurfaceParameters surface;
};

// Runs its owner's functions before Bullet's collision detection, and between that and the solver.
class SteppedWorld final : public btDiscreteDynamicsWorld {
 public:
  using btDiscreteDynamicsWorld::btDiscreteDynamicsWorld;
  std::function<void()> before_detection, before_solving;

  // stepSimulation() would derive the velocities of kinematic bodies from their poses.
  void substep(double dt_s) {
    applyGravity();
    internalSingleStepSimulation(dt_s);
  }

  void performDiscreteCollisionDetection() override {
    before_detection();
    btDiscreteDynamicsWorld::performDiscreteCollisionDetection();
  }

 protected:
  void solveConstraints(btContactSolverInfo& info) override {
    before_solving();
    btDiscreteDynamicsWorld::solveConstraints(info);
  }
};

std::array<float, 3> to_array(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

struct BulletEngine::Impl {
  Impl(const scene::SceneSpec&, const LengthUnit&, surface::Field& scene_field, surface::Field& field,
       const std::vector<scene::ObjectId>& ids);
  ~Impl();

  void select_cells(double step_s);
  bool keeps_points(const btPersistentManifold&) const;
  void forget_points();
  void restore_impulses();
  void prepare_contacts();
  void correct_normal(btManifoldPoint&, const btRigidBody& body, const btRigidBody& cell);
  void prepare_point(btManifoldPoint&, const btRigidBody& a, const btRigidBody& b);
  void read_contacts(std::vector<ContactPoint>& contacts);
  ContactPoint contact_point(const btManifoldPoint&, const btRigidBody& a, const btRigidBody& b) const;
  void advance_columns();
  SurfaceParameters surface_of(const btRigidBody&) const;
  template <class Visit>
  void for_each_point(Visit);

  const LengthUnit& unit;
  surface::Field& scene_field;
  surface::Field& field;                    // the same in world units
  const std::vector<scene::ObjectId>& ids;  // of the bodies
  SurfaceParameters field_surface;
  double substep_s;
  int substeps;
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  ConeFrictionSolver solver;
  SteppedWorld world{&dispatcher, &broadphase, &solver, &configuration};
  btStaticPlaneShape ground_shape{btVector3(0, 0, 1), 0.0};
  std::unique_ptr<btRigidBody> ground;
  CellPool cells;
  std::vector<Body> bodies;                          // one per id
  std::vector<std::unique_ptr<BulletJoint>> joints;  // ascending by id
  std::vector<CellPool::Box> boxes;
  std::vector<ContactDetail> details;
  std::size_t next_detail = 0;
  struct ManifoldImpulse {
    const btPersistentManifold* manifold;
    const btCollisionObject *a, *b;
    double impulse;  // the sum over its points
  };
  std::vector<ManifoldImpulse> last_impulses;  // of the last substep, ascending by address
  std::vector<double> limits;                  // of the columns with a force limit
  std::vector<int> limit_index;                // of each column, or −1
  // By column: the greatest velocity in the last substep of a body that overloads it. The column yields that
  // fast, so that the two stay in touch.
  std::vector<double> yield_speeds;
  std::vector<int> loaded_cells;  // whose Field::impulse is not zero
};

BulletEngine::Impl::Impl(const scene::SceneSpec& scene, const LengthUnit& length_unit,
                         surface::Field& scene_units, surface::Field& world_units,
                         const std::vector<scene::ObjectId>& object_ids)
    : unit(length_unit),
      scene_field(scene_units),
      field(world_units),
      ids(object_ids),
      field_surface(parameters_of(unit.to_world(scene.materials[scene.surface.material]))),
      substeps(substeps_of(scene.world.iterations)),
      cells(world, field,
            unit.to_world(scene.surface.max_top_height() - scene.surface.pin.min_height +
                          scene.surface.pin.length)) {
  substep_s = scene.world.dt_s / substeps;
  world.getDispatchInfo().m_enableSatConvex = true;
  world.setGravity(to_bt(unit.to_world(scene.world.gravity)));
  world.before_detection = [this] { forget_points(); };
  world.before_solving = [this] { prepare_contacts(); };
  btContactSolverInfo& info = world.getSolverInfo();
  info.m_numIterations = kIterations;
  info.m_leastSquaresResidualThreshold = kConverged * kConverged;
  info.m_solverMode =
      SOLVER_USE_WARMSTARTING | SOLVER_USE_2_FRICTION_DIRECTIONS | SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;
  info.m_warmstartingFactor = 1.0;
  info.m_splitImpulse = 1;
  info.m_splitImpulsePenetrationThreshold = std::numeric_limits<btScalar>::max();  // always
  info.m_restitutionVelocityThreshold = 0.0;                                       // prepare_point() decides
  if (scene.world.ground) {
    btRigidBody::btRigidBodyConstructionInfo ground_info(0.0, nullptr, &ground_shape);
    ground_info.m_startWorldTransform.setOrigin({0, 0, unit.to_world(scene.surface.ground_height())});
    ground = std::make_unique<btRigidBody>(ground_info);
    ground->setUserIndex(kGroundIndex);
    world.addRigidBody(ground.get());
  }
  scene_field.impulse.assign(scene_field.height.size(), 0.0F);
}

BulletEngine::Impl::~Impl() {
  joints.clear();
  for (const Body& body : bodies) world.removeRigidBody(body.rigid.get());
  if (ground) world.removeRigidBody(ground.get());
}

void BulletEngine::Impl::select_cells(double step_s) {
  boxes.clear();
  for (const Body& body : bodies) {
    if (body.rigid->getInvMass() == 0.0) continue;
    CellPool::Box box;
    body.rigid->getAabb(box.min, box.max);
    const btScalar turn = body.rigid->getAngularVelocity().length() * (box.max - box.min).length();
    const btScalar fall = world.getGravity().length() * step_s;
    const btScalar margin =
        kCellMargin + 2.0 * step_s * (body.rigid->getLinearVelocity().length() + turn + fall);
    box.min -= btVector3(margin, margin, margin);
    box.max += btVector3(margin, margin, margin);
    if (std::isfinite(margin)) boxes.push_back(box);
  }
  cells.select_near(boxes, step_s);
  limits.clear();
  limit_index.clear();
  for (const CellPool::Column& column : cells.columns()) {
    limit_index.push_back(-1);
    if (!field.has_force_limit()) continue;
    const Index cell = column.cell;
    if (!std::isfinite(field.force_limit[cell])) continue;
    const float force_left = std::clamp(1.0F - field.speed[cell] / field.no_load_speed[cell], 0.0F, 1.0F);
    const auto limit = static_cast<double>(field.force_limit[cell] * force_left);
    limit_index.back() = static_cast<int>(limits.size());
    limits.push_back(limit * substep_s);
  }
  solver.set_cell_limits(limits);
}

SurfaceParameters BulletEngine::Impl::surface_of(const btRigidBody& body) const {
  const int index = body.getUserIndex();
  return index >= 0 ? bodies[index].surface : field_surface;
}

template <class Visit>
void BulletEngine::Impl::for_each_point(Visit visit) {
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
    const auto& a = *static_cast<const btRigidBody*>(manifold.getBody0());
    const auto& b = *static_cast<const btRigidBody*>(manifold.getBody1());
    for (int k = 0; k < manifold.getNumContacts(); ++k) visit(manifold.getContactPoint(k), a, b);
  }
}

bool BulletEngine::Impl::keeps_points(const btPersistentManifold& manifold) const {
  for (const btCollisionObject* body : {manifold.getBody0(), manifold.getBody1()})
    if (body->getUserIndex() >= 0 && bodies[body->getUserIndex()].gathers_points) return true;
  return false;
}

// Bullet keeps points that it found earlier until they have drifted by 2 % of the size. Behind a rolling body
// they would resist its motion.
void BulletEngine::Impl::forget_points() {
  last_impulses.clear();
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
    if (keeps_points(manifold)) continue;
    double impulse = 0.0;
    for (int k = 0; k < manifold.getNumContacts(); ++k)
      impulse += static_cast<double>(manifold.getContactPoint(k).m_appliedImpulse);
    if (impulse > 0.0)
      last_impulses.push_back({&manifold, manifold.getBody0(), manifold.getBody1(), impulse});
    manifold.clearManifold();
  }
  std::ranges::sort(last_impulses, std::less<>(), &ManifoldImpulse::manifold);
}

// The new points share the impulse of those before them, to warm-start the solver.
void BulletEngine::Impl::restore_impulses() {
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
    const auto last =
        std::ranges::lower_bound(last_impulses, &manifold, std::less<>(), &ManifoldImpulse::manifold);
    if (last == last_impulses.end() || last->manifold != &manifold || last->a != manifold.getBody0() ||
        last->b != manifold.getBody1())
      continue;
    for (int k = 0; k < manifold.getNumContacts(); ++k)
      manifold.getContactPoint(k).m_appliedImpulse = last->impulse / manifold.getNumContacts();
  }
}

void BulletEngine::Impl::prepare_contacts() {
  restore_impulses();
  std::size_t count = 0;
  for_each_point([&count](const btManifoldPoint&, const btRigidBody&, const btRigidBody&) { ++count; });
  details.resize(count);
  next_detail = 0;
  for_each_point(
      [this](btManifoldPoint& p, const btRigidBody& a, const btRigidBody& b) { prepare_point(p, a, b); });
  solver.clear_cell_loads();
}

// A flat face that slides over level cells sinks a little and would hit their sides.
void BulletEngine::Impl::correct_normal(btManifoldPoint& p, const btRigidBody& body,
                                        const btRigidBody& cell) {
  const double normal_z = std::abs(p.m_normalWorldOnB.z());
  if (normal_z >= kMaxEdgeNormalZ) return;
  btVector3 body_min, body_max, cell_min, cell_max;
  body.getAabb(body_min, body_max);
  cell.getAabb(cell_min, cell_max);
  if (body_min.z() < cell_max.z() - kTopDepth) return;
  const double sign = p.m_normalWorldOnB.z() < 0.0 ? -1.0 : 1.0;
  if (normal_z < kMinTopNormalZ) {
    p.m_distance1 = std::numeric_limits<btScalar>::max();
    p.m_appliedImpulse = 0.0;
    return;
  }
  p.m_normalWorldOnB = btVector3(0, 0, sign);
  p.m_distance1 *= normal_z;
}

void BulletEngine::Impl::prepare_point(btManifoldPoint& p, const btRigidBody& a, const btRigidBody& b) {
  const SurfaceParameters sa = surface_of(a), sb = surface_of(b);
  p.m_combinedFriction = std::sqrt(sa.friction * sb.friction);
  p.m_combinedRollingFriction = p.m_combinedSpinningFriction = 0.0;  // ConeFrictionSolver has its own
  ContactDetail& detail = details[next_detail++];
  detail = {std::sqrt(sa.rolling_friction * sb.rolling_friction), -1};
  p.m_userPersistentData = &detail;

  const bool a_is_cell = a.getUserIndex() < kGroundIndex, b_is_cell = b.getUserIndex() < kGroundIndex;
  const int cell = cell_user_index(a_is_cell ? a.getUserIndex() : b.getUserIndex());  // if one is a cell
  const bool on_column = (a_is_cell || b_is_cell) && field.is_column(cell);
  if (on_column) correct_normal(p, a_is_cell ? b : a, a_is_cell ? a : b);
  const btVector3 at = p.getPositionWorldOnB();
  const btVector3 relative_velocity = a.getVelocityInLocalPoint(at - a.getCenterOfMassPosition()) -
                                      b.getVelocityInLocalPoint(at - b.getCenterOfMassPosition());
  const btScalar approach = -relative_velocity.dot(p.m_normalWorldOnB);
  const double restitution = std::max(sa.restitution, sb.restitution);
  const bool bounces = restitution > 0.0 && approach > static_cast<double>(kRestitutionThreshold);
  p.m_combinedRestitution = bounces ? restitution : 0.0;
  p.m_contactPointFlags = BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED | BT_CONTACT_FLAG_HAS_CONTACT_CFM;
  const btScalar mobility = a.getInvMass() + b.getInvMass();
  // Bullet divides the compliance by the time step.
  p.m_contactCFM = bounces ? 0.0 : kRelativeCompliance * mobility * substep_s;
  // Bullet also solves contacts that are still open, along their current normal. An impact would lose its
  // rebound, and a ball that rolls from cell to cell would hit their edges: these contacts wait until they
  // touch.
  const double normal_z = std::abs(p.m_normalWorldOnB.z());
  if (p.getDistance() > 0.0 && p.getDistance() < kTouchingGap) p.m_distance1 = 0.0;
  const bool is_edge = on_column && normal_z > kMinEdgeNormalZ && normal_z < kMaxEdgeNormalZ;
  if ((bounces || is_edge) && p.getDistance() > 0.0) {
    p.m_distance1 = std::numeric_limits<btScalar>::max();
    p.m_appliedImpulse = 0.0;
  }

  btPlaneSpace1(p.m_normalWorldOnB, p.m_lateralFrictionDir1, p.m_lateralFrictionDir2);
  p.m_contactMotion1 = p.m_contactMotion2 = 0.0;
  if (!a_is_cell && !b_is_cell) return;
  if (!limits.empty() && normal_z > kMinLimitedNormalZ)
    detail.limited_cell = limit_index[&cells.column(cell) - cells.columns().data()];
  if (!field.has_surface_velocity() || !on_column || normal_z < kMinTopNormalZ) return;
  const Eigen::Vector2d centre = field.centre(cell).cast<double>();
  const double spin = field.surface_spin.empty() ? 0.0 : static_cast<double>(field.surface_spin[cell]);
  // The surface of a cell that turns has the velocity of where the body is in the middle of the substep.
  const btVector3 lever = at + 0.5 * substep_s * (a_is_cell ? b : a).getLinearVelocity();
  const btVector3 surface(
      static_cast<double>(field.surface_velocity_x[cell]) - spin * (lever.y() - centre.y()),
      static_cast<double>(field.surface_velocity_y[cell]) + spin * (lever.x() - centre.x()), 0.0);
  const double sign = a_is_cell ? -1.0 : 1.0;
  p.m_contactMotion1 = sign * surface.dot(p.m_lateralFrictionDir1);
  p.m_contactMotion2 = sign * surface.dot(p.m_lateralFrictionDir2);
}

// In scene units. The impulse is that of the last substep.
ContactPoint BulletEngine::Impl::contact_point(const btManifoldPoint& p, const btRigidBody& a,
                                               const btRigidBody& b) const {
  // Bullet's normal points towards a.
  const bool towards_a = a.getUserIndex() >= 0;
  const int object = towards_a ? a.getUserIndex() : b.getUserIndex();
  const int other = towards_a ? b.getUserIndex() : a.getUserIndex();
  const btVector3 normal = towards_a ? p.m_normalWorldOnB : -p.m_normalWorldOnB;
  return {unit.to_scene(to_eigen(p.getPositionWorldOnB())).cast<float>(), to_eigen(normal).cast<float>(),
          unit.to_scene(static_cast<float>(p.m_appliedImpulse)), ids[object],
          other >= 0 ? std::optional(ids[other]) : std::nullopt};
}

// Adds the substep's impulses to the field. A saturated cell follows the bodies on it.
void BulletEngine::Impl::read_contacts(std::vector<ContactPoint>& contacts) {
  yield_speeds.assign(cells.columns().size(), kHolds);
  for_each_point([&](const btManifoldPoint& p, const btRigidBody& a, const btRigidBody& b) {
    const auto impulse = static_cast<double>(p.m_appliedImpulse);
    if (!(impulse > 0.0) || p.getDistance() == std::numeric_limits<btScalar>::max()) return;
    contacts.push_back(contact_point(p, a, b));
    const bool a_is_cell = a.getUserIndex() < kGroundIndex;
    if (!a_is_cell && b.getUserIndex() >= kGroundIndex) return;
    const int cell = cell_user_index(a_is_cell ? a.getUserIndex() : b.getUserIndex());
    float& total = scene_field.impulse[cell];
    if (total == 0.0F) loaded_cells.push_back(cell);
    total += unit.to_scene(static_cast<float>(impulse));
    if (field.has_offset())  // Bullet's normal points towards a
      scene_field.tip_impulse[cell] +=
          unit.to_scene(to_eigen((a_is_cell ? impulse : -impulse) * p.m_normalWorldOnB)).cast<float>();
    const auto* detail = static_cast<const ContactDetail*>(p.m_userPersistentData);
    const int limited = detail->limited_cell;
    if (limited < 0) return;
    constexpr double kSaturated = 0.999;
    if (solver.cell_loads()[limited] < kSaturated * limits[limited]) return;
    const btRigidBody& body = a_is_cell ? b : a;
    const btVector3 velocity =
        body.getVelocityInLocalPoint(p.getPositionWorldOnB() - body.getCenterOfMassPosition());
    double& speed = yield_speeds[&cells.column(cell) - cells.columns().data()];
    speed = std::max(speed, velocity.dot(p.m_normalWorldOnB) / p.m_normalWorldOnB.z());
  });
}

void BulletEngine::Impl::advance_columns() {
  std::size_t k = 0;
  for (CellPool::Column& column : cells.columns()) {
    const double yield_speed = yield_speeds[k++];
    column.top += (yield_speed == kHolds ? column.speed : std::min(column.speed, yield_speed)) * substep_s;
    column.elapsed_s += substep_s;
    cells.update_body(column);
  }
}

BulletEngine::BulletEngine(const scene::SceneSpec& scene, surface::Field& field, common::ThreadPool* pool)
    : unit_(scene.surface.pitch),
      materials_(scene.materials),
      scene_field_(field),
      field_copy_(unit_.is_one() ? surface::Field() : unit_.to_world(field)),
      field_(unit_.is_one() ? field : field_copy_),
      dt_s_(scene.world.dt_s),
      field_hasher_(pool),
      impl_(std::make_unique<Impl>(scene, unit_, scene_field_, field_, ids_)) {
  add_all(scene);
}

BulletEngine::~BulletEngine() = default;

std::string BulletEngine::version() const {
  return SMARTSURF_VERSION "+bullet" + std::to_string(btGetVersion() / 100) + "." +
         std::to_string(btGetVersion() % 100);
}

int BulletEngine::find(scene::ObjectId id) const {
  const auto it = std::lower_bound(ids_.begin(), ids_.end(), id);
  return it != ids_.end() && *it == id ? static_cast<int>(it - ids_.begin()) : -1;
}

void BulletEngine::read_body(std::size_t i) {
  const Body& body = impl_->bodies[i];
  const btTransform& pose = body.rigid->getWorldTransform();
  const Eigen::Quaterniond orientation =
      (to_eigen(pose.getRotation()) * body.shape.principal_axes.conjugate()).normalized();
  const Eigen::Vector3d to_origin = orientation * -body.shape.centre_of_mass;
  positions_[i] = unit_.to_scene(Eigen::Vector3d(to_eigen(pose.getOrigin()) + to_origin)).cast<float>();
  orientations_[i] = orientation.cast<float>();
  velocities_[i] =
      unit_.to_scene(to_eigen(body.rigid->getVelocityInLocalPoint(to_bt(to_origin)))).cast<float>();
  angular_velocities_[i] = to_eigen(body.rigid->getAngularVelocity()).cast<float>();
}

scene::ObjectId BulletEngine::add(const scene::ObjectSpec& scene_spec) {
  const scene::Material& material = materials_[scene_spec.material];
  const scene::ObjectSpec spec = unit_.to_world(scene_spec, material);
  const double mass = spec.fixed ? 0.0 : spec.mass.value_or(material.density * spec.volume());
  Body body{gathers_points(spec.shape), make_bullet_shape(spec, mass), nullptr,
            parameters_of(unit_.to_world(material))};
  if (spec.friction) body.surface.friction = *spec.friction;
  if (!resists_rolling(spec.shape)) body.surface.rolling_friction = 0.0;
  btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, body.shape.shape, body.shape.inertia);
  const Eigen::Vector3d to_centre = spec.orientation.normalized() * spec.centre_of_mass;
  info.m_startWorldTransform =
      btTransform(to_bt(Eigen::Quaterniond(spec.orientation.normalized() * body.shape.principal_axes)),
                  to_bt(Eigen::Vector3d(spec.position + to_centre)));
  body.rigid = std::make_unique<btRigidBody>(info);
  body.rigid->setActivationState(DISABLE_DEACTIVATION);
  body.rigid->setUserIndex(static_cast<int>(ids_.size()));
  if (mass > 0.0) {
    body.rigid->setLinearVelocity(
        to_bt(Eigen::Vector3d(spec.velocity + spec.angular_velocity.cross(to_centre))));
    body.rigid->setAngularVelocity(to_bt(spec.angular_velocity));
  }
  impl_->world.addRigidBody(body.rigid.get());
  impl_->bodies.push_back(std::move(body));
  ids_.push_back(next_id_);
  positions_.emplace_back();
  orientations_.emplace_back();
  velocities_.emplace_back();
  angular_velocities_.emplace_back();
  masses_.push_back(static_cast<float>(mass));
  wrenches_.emplace_back();
  read_body(ids_.size() - 1);
  return next_id_++;
}

bool BulletEngine::alive(scene::ObjectId id) const { return find(id) >= 0; }

bool BulletEngine::remove(scene::ObjectId id) {
  const int index = find(id);
  if (index < 0) return false;
  btRigidBody& rigid = *impl_->bodies[index].rigid;
  std::erase_if(impl_->joints, [&rigid](const auto& joint) { return joint->connects(rigid); });
  impl_->world.removeRigidBody(&rigid);
  auto erase = [index](auto& all) { all.erase(all.begin() + index); };
  erase(impl_->bodies), erase(ids_), erase(positions_), erase(orientations_), erase(velocities_);
  erase(angular_velocities_), erase(masses_), erase(wrenches_);
  for (int i = index; i < std::ssize(ids_); ++i) impl_->bodies[i].rigid->setUserIndex(i);
  std::erase_if(timed_forces_, [id](const TimedForce& f) { return f.id == id; });
  return true;
}

bool BulletEngine::set_state(scene::ObjectId id, const scene::ObjectStateUpdate& scene_update) {
  const int index = find(id);
  if (index < 0) return false;
  Body& body = impl_->bodies[index];
  const scene::ObjectStateUpdate update = unit_.to_world(scene_update);
  const scene::ObjectState now = state(id);
  const Eigen::Quaterniond orientation = update.orientation.value_or(now.orientation).normalized();
  const Eigen::Vector3d to_centre = orientation * body.shape.centre_of_mass;
  const bool has_offset = !body.shape.centre_of_mass.isZero(0.0);
  btTransform pose = body.rigid->getWorldTransform();
  if (update.position || has_offset)
    pose.setOrigin(
        to_bt(Eigen::Vector3d(update.position.value_or(unit_.to_world(now.position)) + to_centre)));
  if (update.orientation)
    pose.setRotation(to_bt(Eigen::Quaterniond(orientation * body.shape.principal_axes)));
  if (update.position || update.orientation) {
    body.rigid->setWorldTransform(pose);
    body.rigid->setInterpolationWorldTransform(pose);
    body.rigid->updateInertiaTensor();
    // The contacts of the old place would pull the body back.
    impl_->broadphase.getOverlappingPairCache()->cleanProxyFromPairs(body.rigid->getBroadphaseProxy(),
                                                                     &impl_->dispatcher);
    impl_->world.updateSingleAabb(body.rigid.get());
  }
  if (update.angular_velocity && masses_[index] > 0.0F)
    body.rigid->setAngularVelocity(to_bt(*update.angular_velocity));
  if ((update.velocity || has_offset) && masses_[index] > 0.0F) {
    const Eigen::Vector3d spin = to_eigen(body.rigid->getAngularVelocity());
    body.rigid->setLinearVelocity(to_bt(
        Eigen::Vector3d(update.velocity.value_or(unit_.to_world(now.velocity)) + spin.cross(to_centre))));
  }
  read_body(index);
  return true;
}

bool BulletEngine::apply_force(scene::ObjectId id, const Eigen::Vector3d& force,
                               const std::optional<Eigen::Vector3d>& point, double duration_s) {
  const int index = find(id);
  if (index < 0) return false;
  const scene::ObjectState now = state(id);
  const Eigen::Vector3d local_point =
      point ? Eigen::Vector3d(now.orientation.conjugate() * unit_.to_world(*point - now.position) -
                              impl_->bodies[index].shape.centre_of_mass)
            : Eigen::Vector3d::Zero();
  timed_forces_.push_back({id, unit_.to_world(force), local_point, StepCountdown(duration_s, dt_s_)});
  return true;
}

scene::ObjectState BulletEngine::state(scene::ObjectId id) const {
  const Index i = find(id);
  return {positions_[i].cast<double>(), orientations_[i].cast<double>(), velocities_[i].cast<double>(),
          angular_velocities_[i].cast<double>()};
}

BulletJoint* BulletEngine::find_joint(scene::JointId id) const {
  const auto it =
      std::ranges::lower_bound(impl_->joints, id, {}, [](const auto& joint) { return joint->id(); });
  return it != impl_->joints.end() && (*it)->id() == id ? it->get() : nullptr;
}

scene::JointId BulletEngine::add_joint(const scene::JointSpec& spec) {
  auto body_of = [this](scene::ObjectId id) { return impl_->bodies[find(id)].rigid.get(); };
  impl_->joints.push_back(std::make_unique<BulletJoint>(next_joint_id_, unit_.to_world(spec), impl_->world,
                                                        *body_of(spec.a),
                                                        spec.b ? body_of(*spec.b) : nullptr));
  return next_joint_id_++;
}

bool BulletEngine::has_joint(scene::JointId id) const { return find_joint(id) != nullptr; }

void BulletEngine::remove_joint(scene::JointId id) {
  std::erase_if(impl_->joints, [id](const auto& joint) { return joint->id() == id; });
}

void BulletEngine::set_motor(scene::JointId id, const scene::JointMotor& motor) {
  BulletJoint& joint = *find_joint(id);
  joint.set_motor(unit_.to_world(joint.kind(), motor));
}

void BulletEngine::set_spring(scene::JointId id, const scene::JointSpring& spring) {
  BulletJoint& joint = *find_joint(id);
  joint.set_spring(unit_.to_world(joint.kind(), spring));
}

scene::JointState BulletEngine::joint_state(scene::JointId id) const {
  const BulletJoint& joint = *find_joint(id);
  return unit_.to_scene(joint.kind(), joint.state(dt_s_));
}

surface::BodyView BulletEngine::bodies() const {
  led_positions_.resize(ids_.size()), led_orientations_.resize(ids_.size());
  const float lead_s =
      mean_substep_start(static_cast<float>(impl_->substep_s * impl_->substeps), impl_->substeps);
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    const Eigen::Vector3f turn = lead_s * angular_velocities_[i];
    led_positions_[i] = positions_[i] + lead_s * velocities_[i];
    led_orientations_[i] = orientations_[i];
    if (!turn.isZero(0.0F))
      led_orientations_[i] =
          Eigen::Quaternionf(Eigen::AngleAxisf(turn.norm(), turn.normalized())) * orientations_[i];
  }
  return {ids_, led_positions_, led_orientations_, velocities_, angular_velocities_, masses_};
}

void BulletEngine::apply_timed_forces() {
  for (TimedForce& f : timed_forces_) {
    const Index i = find(f.id);
    const Eigen::Vector3d force = f.time_left.take() * f.force;
    wrenches_[i].force += force.cast<float>();
    wrenches_[i].torque +=
        Eigen::Vector3d(orientations_[i].cast<double>() * f.local_point).cross(force).cast<float>();
  }
  std::erase_if(timed_forces_, [](const TimedForce& f) { return f.time_left.is_over(); });
}

void BulletEngine::step() {
  Impl& s = *impl_;
  if (!unit_.is_one()) unit_.update_motion(scene_field_, field_copy_, nullptr);
  // Wrenches come in scene units and act about the origin, Bullet's about the centre of mass.
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    surface::Wrench& wrench = wrenches_[i];
    const Eigen::Vector3f centre_of_mass = s.bodies[i].shape.centre_of_mass.cast<float>();
    wrench = unit_.to_world(wrench);
    wrench.torque -= (orientations_[i] * centre_of_mass).cross(wrench.force);
  }
  apply_timed_forces();
  for (const int cell : s.loaded_cells) {
    scene_field_.impulse[cell] = 0.0F;
    if (field_.has_offset()) scene_field_.tip_impulse[cell].setZero();
  }
  s.loaded_cells.clear();
  contacts_.clear();
  s.select_cells(dt_s_);
  for (const auto& joint : s.joints) joint->begin_step();
  for (int k = 0; k < s.substeps; ++k) {
    s.world.clearForces();
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (wrenches_[i].is_zero() || masses_[i] == 0.0F) continue;
      s.bodies[i].rigid->applyCentralForce(to_bt(wrenches_[i].force));
      s.bodies[i].rigid->applyTorque(to_bt(wrenches_[i].torque));
    }
    for (const auto& joint : s.joints) joint->begin_substep(s.substep_s);
    s.world.substep(s.substep_s);
    const std::size_t earlier = contacts_.size();
    s.read_contacts(contacts_);
    contact_count_ = contacts_.size() - earlier;
    s.advance_columns();
    for (const auto& joint : s.joints) joint->end_substep(s.substep_s);
  }
  s.world.clearForces();
  if (field_.has_force_limit()) {
    for (const CellPool::Column& column : s.cells.columns()) {
      const double height = field_.height[column.cell];
      float& speed = field_.speed[column.cell];
      if (std::isfinite(field_.force_limit[column.cell]))
        speed = std::min(speed, static_cast<float>((column.top - height) / dt_s_));
    }
    if (!unit_.is_one()) unit_.return_lowered_speeds(field_, scene_field_);
  }
  for (std::size_t i = 0; i < ids_.size(); ++i) read_body(i);
  std::fill(wrenches_.begin(), wrenches_.end(), surface::Wrench{});
}

void BulletEngine::snapshot(scene::Snapshot& out, bool /*with_hash*/) const {
  out.id = ids_;
  const std::size_t n = ids_.size();
  out.position.resize(n);
  out.orientation.resize(n);
  out.velocity.resize(n);
  out.angular_velocity.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Quaternionf& q = orientations_[i];
    out.position[i] = to_array(positions_[i]);
    out.orientation[i] = {q.x(), q.y(), q.z(), q.w()};
    out.velocity[i] = to_array(velocities_[i]);
    out.angular_velocity[i] = to_array(angular_velocities_[i]);
  }
  StateHash hash = hash_objects(out);
  field_hasher_.copy_and_hash(scene_field_, true, out.height, hash);
  out.state_hash = hash.value();
  out.contact_count = static_cast<std::uint32_t>(contact_count_);
}

std::optional<scene::ObjectId> BulletEngine::first_non_finite() const {
  for (std::size_t i = 0; i < ids_.size(); ++i)
    if (!positions_[i].allFinite() || !velocities_[i].allFinite() || !angular_velocities_[i].allFinite())
      return ids_[i];
  return std::nullopt;
}

}  // namespace smartsurf::world
