#include "smartsurf/world/World.h"

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "smartsurf/world/BulletShapes.h"
#include "smartsurf/world/FieldCollision.h"
#include "smartsurf/world/StateHash.h"
#include "smartsurf/world/SurfaceVelocitySolver.h"

namespace smartsurf::world {
namespace {

struct Body {
  std::unique_ptr<BodyTag> tag;  // at a fixed address: the rigid body's user pointer
  std::unique_ptr<btConvexShape> shape;
  std::unique_ptr<btRigidBody> rigid;
};

struct Push {
  scene::ObjectId id;
  btVector3 force, arm;  // arm: where it acts, in the body's own frame
  long steps_left;
};

btDefaultCollisionConstructionInfo pool_sizes() {
  btDefaultCollisionConstructionInfo info;
  info.m_customCollisionAlgorithmMaxElementSize = field_algorithm_size();
  return info;
}

Eigen::Vector3d from_bullet(const btVector3& v) {
  return Eigen::Vector3f(v.x(), v.y(), v.z()).cast<double>();
}

std::array<float, 3> array_of(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

bool finite(const btVector3& v) { return std::isfinite(v.x()) && std::isfinite(v.y()) && std::isfinite(v.z()); }

}  // namespace

struct World::State {
  State(const scene::SceneSpec& scene, surface::Field& surface_field)
      : materials(scene.materials),
        field(surface_field),
        dt_s(static_cast<btScalar>(scene.world.dt_s)),
        configuration(pool_sizes()),
        dispatcher(&configuration),
        solver(surface_field),
        dynamics(&dispatcher, &broadphase, &solver, &configuration) {
    install_material_rule();
    register_field_collision(dispatcher);
    dynamics.setGravity(to_bullet(scene.world.gravity));
    // Pairs in an order that does not depend on the broadphase's history.
    dynamics.getDispatchInfo().m_deterministicOverlappingPairs = true;
    btContactSolverInfo& info = dynamics.getSolverInfo();
    info.m_numIterations = scene.world.iterations;
    info.m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;  // one direction alone lets resting bodies creep
    info.m_splitImpulsePenetrationThreshold = 0.0F;         // push apart without adding momentum, at any depth
    add_field(scene);
    if (scene.world.ground) add_ground(scene);
  }

  ~State() {
    for (auto& body : bodies) dynamics.removeRigidBody(body.rigid.get());
    for (auto& fixture : fixtures) dynamics.removeRigidBody(fixture.get());
  }

  static float floor_height(const scene::SceneSpec& scene) {
    return static_cast<float>(scene.surface.pin.min_height - scene.surface.pin.length);
  }

  void add_field(const scene::SceneSpec& scene) {
    const double highest = std::max(scene.surface.pin.max_height, scene.surface.border_height.value_or(0.0));
    field_shape = std::make_unique<FieldShape>(field, floor_height(scene), static_cast<float>(highest) + 0.1F, dt_s);
    add_fixture(*field_shape, scene.materials[static_cast<std::size_t>(scene.surface.material)]);
  }

  void add_ground(const scene::SceneSpec& scene) {
    ground_shape = std::make_unique<btStaticPlaneShape>(btVector3(0, 0, 1), floor_height(scene));
    add_fixture(*ground_shape, scene.materials[static_cast<std::size_t>(scene.surface.material)]);
  }

  void add_fixture(btCollisionShape& shape, const scene::Material& material) {
    fixtures.push_back(std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &shape)));
    set_material(*fixtures.back(), material, true);
    dynamics.addRigidBody(fixtures.back().get());
  }

  Body* find(scene::ObjectId id) {
    const auto it = std::lower_bound(bodies.begin(), bodies.end(), id,
                                     [](const Body& b, scene::ObjectId wanted) { return b.tag->id < wanted; });
    return it != bodies.end() && it->tag->id == id ? &*it : nullptr;
  }

  std::vector<scene::Material> materials;
  surface::Field& field;
  btScalar dt_s;
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher;
  btDbvtBroadphase broadphase;
  SurfaceVelocitySolver solver;
  btDiscreteDynamicsWorld dynamics;
  std::unique_ptr<FieldShape> field_shape;
  std::unique_ptr<btStaticPlaneShape> ground_shape;
  std::vector<std::unique_ptr<btRigidBody>> fixtures;
  std::vector<Body> bodies;  // ascending by id
  scene::ObjectId next_id = 0;
  std::vector<Push> pushes;

  void apply_wrenches();
  void weigh_cells();
  void list_bodies();

  // What actuators see, and what they do.
  struct {
    std::vector<scene::ObjectId> id;
    std::vector<Eigen::Vector3f> position, velocity, angular_velocity;
    std::vector<Eigen::Quaternionf> orientation;
    std::vector<float> mass;
  } seen;
  std::vector<surface::Wrench> wrenches;
};

void World::State::apply_wrenches() {
  for (std::size_t i = 0; i < std::min(wrenches.size(), bodies.size()); ++i) {
    const surface::Wrench& w = wrenches[i];
    bodies[i].rigid->applyCentralForce({w.force.x(), w.force.y(), w.force.z()});
    bodies[i].rigid->applyTorque({w.torque.x(), w.torque.y(), w.torque.z()});
  }
  std::ranges::fill(wrenches, surface::Wrench{});
}

void World::State::weigh_cells() {
  std::ranges::fill(field.impulse, 0.0F);
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
      const btManifoldPoint& point = manifold.getContactPoint(k);
      if (point.m_partId1 == kFieldPart) field.impulse[static_cast<std::size_t>(point.m_index1)] += point.m_appliedImpulse;
    }
  }
}

void World::State::list_bodies() {
  const std::size_t n = bodies.size();
  seen.id.resize(n);
  seen.position.resize(n);
  seen.orientation.resize(n);
  seen.velocity.resize(n);
  seen.angular_velocity.resize(n);
  seen.mass.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const btRigidBody& rigid = *bodies[i].rigid;
    const btQuaternion q = rigid.getWorldTransform().getRotation();
    seen.id[i] = bodies[i].tag->id;
    seen.position[i] = from_bullet(rigid.getWorldTransform().getOrigin()).cast<float>();
    seen.orientation[i] = {q.w(), q.x(), q.y(), q.z()};
    seen.velocity[i] = from_bullet(rigid.getLinearVelocity()).cast<float>();
    seen.angular_velocity[i] = from_bullet(rigid.getAngularVelocity()).cast<float>();
    seen.mass[i] = rigid.getInvMass() > 0.0F ? 1.0F / rigid.getInvMass() : 0.0F;
  }
}

std::string physics_version() {
  const int version = btGetVersion();
  return std::to_string(version / 100) + "." + std::to_string(version % 100);
}

World::World(const scene::SceneSpec& scene, surface::Field& field)
    : state_(std::make_unique<State>(scene, field)) {
  for (const auto& object : scene.objects) add(object);
}

World::~World() = default;

scene::ObjectId World::add(const scene::ObjectSpec& spec) {
  const scene::Material& material = state_->materials[static_cast<std::size_t>(spec.material)];
  Body body;
  body.tag = std::make_unique<BodyTag>(BodyTag{spec, state_->next_id++});
  body.shape = make_shape(spec);
  const double mass = mass_of(spec, material);
  btRigidBody::btRigidBodyConstructionInfo info(static_cast<btScalar>(mass), nullptr, body.shape.get(),
                                                inertia_of(spec, mass));
  info.m_startWorldTransform = btTransform(to_bullet(spec.orientation), to_bullet(spec.position));
  body.rigid = std::make_unique<btRigidBody>(info);
  body.rigid->setUserPointer(body.tag.get());
  set_material(*body.rigid, material, spec.shape != scene::ShapeKind::kBox);
  body.rigid->setLinearVelocity(to_bullet(spec.velocity));
  body.rigid->setAngularVelocity(to_bullet(spec.angular_velocity));
  // A body asleep would not feel a pin rising under it.
  body.rigid->setActivationState(DISABLE_DEACTIVATION);
  state_->dynamics.addRigidBody(body.rigid.get());
  state_->bodies.push_back(std::move(body));
  return state_->bodies.back().tag->id;
}

bool World::alive(scene::ObjectId id) const { return state_->find(id) != nullptr; }

bool World::remove(scene::ObjectId id) {
  Body* body = state_->find(id);
  if (!body) return false;
  state_->dynamics.removeRigidBody(body->rigid.get());
  state_->bodies.erase(state_->bodies.begin() + (body - state_->bodies.data()));
  std::erase_if(state_->pushes, [id](const Push& p) { return p.id == id; });
  return true;
}

bool World::place(scene::ObjectId id, const scene::Placement& placement) {
  const Body* body = state_->find(id);
  if (!body) return false;
  btRigidBody& rigid = *body->rigid;
  btTransform pose = rigid.getWorldTransform();
  if (placement.position) pose.setOrigin(to_bullet(*placement.position));
  if (placement.orientation) pose.setRotation(to_bullet(*placement.orientation));
  rigid.setWorldTransform(pose);
  rigid.setInterpolationWorldTransform(pose);
  if (placement.velocity) rigid.setLinearVelocity(to_bullet(*placement.velocity));
  if (placement.angular_velocity) rigid.setAngularVelocity(to_bullet(*placement.angular_velocity));
  rigid.updateInertiaTensor();
  return true;
}

bool World::push(scene::ObjectId id, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
                 double duration_s) {
  const Body* body = state_->find(id);
  if (!body) return false;
  const long steps = std::max(1L, std::lround(duration_s / static_cast<double>(state_->dt_s)));
  const btTransform& pose = body->rigid->getWorldTransform();
  const btVector3 arm = point ? pose.invXform(to_bullet(*point)) : btVector3(0, 0, 0);
  state_->pushes.push_back({id, to_bullet(force), arm, steps});
  return true;
}

scene::ObjectState World::state(scene::ObjectId id) const {
  const btRigidBody& body = *state_->find(id)->rigid;
  const btQuaternion q = body.getWorldTransform().getRotation();
  return {from_bullet(body.getWorldTransform().getOrigin()), Eigen::Quaterniond(q.w(), q.x(), q.y(), q.z()),
          from_bullet(body.getLinearVelocity()), from_bullet(body.getAngularVelocity())};
}

void World::step() {
  for (Push& p : state_->pushes) {
    btRigidBody& body = *state_->find(p.id)->rigid;
    body.applyForce(p.force, body.getWorldTransform().getBasis() * p.arm);
    --p.steps_left;
  }
  std::erase_if(state_->pushes, [](const Push& p) { return p.steps_left == 0; });
  state_->apply_wrenches();
  state_->dynamics.stepSimulation(state_->dt_s, 0);
  state_->weigh_cells();
}

surface::Bodies World::bodies() const {
  state_->list_bodies();
  const auto& seen = state_->seen;
  return {seen.id, seen.position, seen.orientation, seen.velocity, seen.angular_velocity, seen.mass};
}

std::span<surface::Wrench> World::wrenches() {
  state_->wrenches.resize(state_->bodies.size());
  return state_->wrenches;
}

void World::snapshot(scene::Snapshot& out) const {
  const std::size_t n = state_->bodies.size();
  out.id.resize(n);
  out.position.resize(n);
  out.orientation.resize(n);
  out.velocity.resize(n);
  out.angular_velocity.resize(n);
  StateHash hash;
  for (std::size_t i = 0; i < n; ++i) {
    const Body& body = state_->bodies[i];
    const btTransform& pose = body.rigid->getWorldTransform();
    const btQuaternion q = pose.getRotation();
    out.id[i] = body.tag->id;
    out.position[i] = array_of(pose.getOrigin());
    out.orientation[i] = {q.x(), q.y(), q.z(), q.w()};
    out.velocity[i] = array_of(body.rigid->getLinearVelocity());
    out.angular_velocity[i] = array_of(body.rigid->getAngularVelocity());
    hash.add(out.id[i]);
    hash.add(out.position[i]);
    hash.add(out.orientation[i]);
    hash.add(out.velocity[i]);
    hash.add(out.angular_velocity[i]);
  }
  out.height = state_->field.height;
  hash.add(state_->field.height);
  hash.add(state_->field.speed);
  if (state_->field.drags()) {
    hash.add(state_->field.drag_x);
    hash.add(state_->field.drag_y);
    hash.add(state_->field.spin);
  }
  out.state_hash = hash.value();
  out.contacts = 0;
  for (int i = 0; i < state_->dispatcher.getNumManifolds(); ++i)
    out.contacts += static_cast<std::uint32_t>(state_->dispatcher.getManifoldByIndexInternal(i)->getNumContacts());
}

std::optional<scene::ObjectId> World::first_not_finite() const {
  for (const Body& body : state_->bodies) {
    const btRigidBody& b = *body.rigid;
    if (!finite(b.getWorldTransform().getOrigin()) || !finite(b.getLinearVelocity()) || !finite(b.getAngularVelocity()))
      return body.tag->id;
  }
  return std::nullopt;
}

}  // namespace smartsurf::world
