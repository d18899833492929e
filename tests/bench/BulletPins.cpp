#include "tests/bench/BulletPins.h"

using namespace pin_scene;
using smartsurf::scene::ShapeKind;

namespace {

constexpr float kHalfTop = 0.4F, kHalfLength = 1.0F, kHalfBorder = 3.5F;
constexpr int kObjects = 1, kPins = 2, kWalls = 4, kRays = 8, kEverything = -1;

btVector3 vec(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

btDefaultCollisionConstructionInfo pools() {
  btDefaultCollisionConstructionInfo info;
  info.m_defaultMaxPersistentManifoldPoolSize = info.m_defaultMaxCollisionAlgorithmPoolSize = 80000;
  return info;
}

}  // namespace

BulletPins::BulletPins(const Workload& w)
    : w_(w),
      configuration_(pools()),
      dispatcher_(&configuration_),
      world_(&dispatcher_, &broadphase_, &solver_, &configuration_) {
  world_.setGravity({0, 0, -10});
  auto shape = [this](auto s) { return shapes_.emplace_back(std::move(s)).get(); };
  auto* pin = shape(std::make_unique<btBoxShape>(btVector3(kHalfTop, kHalfTop, kHalfLength)));
  auto* tall = shape(std::make_unique<btBoxShape>(btVector3(kHalfTop, kHalfTop, kHalfBorder)));
  for (int i = 0; i < w.n * w.n; ++i) {
    btRigidBody* b = add(is_border(i) ? tall : pin, pin_position(i, is_border(i) ? kBorderHeight : 0.0F), 0,
                         kPins, kObjects);
    if (!is_border(i)) {
      b->setCollisionFlags(b->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
      b->setActivationState(DISABLE_DEACTIVATION);
    }
    pins_.push_back(b);
  }
  for (const Wall& wall : make_walls(w))
    add(shape(std::make_unique<btBoxShape>(vec(wall.half))), vec(wall.centre), 0, kWalls, kObjects);
  for (const auto& o : make_objects(w)) {
    const btVector3 half = vec(o.half_extents());
    btCollisionShape* s = nullptr;
    if (o.shape == ShapeKind::kSphere) s = shape(std::make_unique<btSphereShape>(half.x()));
    if (o.shape == ShapeKind::kBox) s = shape(std::make_unique<btBoxShape>(half));
    if (o.shape == ShapeKind::kCylinder) s = shape(std::make_unique<btCylinderShapeZ>(half));
    if (o.shape == ShapeKind::kSolid) {
      auto hull = std::make_unique<btConvexHullShape>();
      for (const auto& corner : o.solid->vertices) hull->addPoint(vec(corner.cast<double>()), false);
      hull->recalcLocalAabb();
      s = shape(std::move(hull));
    }
    objects_.push_back(add(s, vec(o.position), static_cast<float>(o.volume()), kObjects, kEverything));
  }
}

BulletPins::~BulletPins() {
  for (auto& b : bodies_) world_.removeRigidBody(b.get());
}

btRigidBody* BulletPins::add(btCollisionShape* shape, const btVector3& at, float mass, int group, int mask) {
  btVector3 inertia(0, 0, 0);
  if (mass > 0) shape->calculateLocalInertia(mass, inertia);
  btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape, inertia);
  info.m_startWorldTransform.setIdentity();
  info.m_startWorldTransform.setOrigin(at);
  info.m_friction = 0.5F;  // Bullet multiplies both frictions: 0.25 per contact, as in make_scene()
  bodies_.push_back(std::make_unique<btRigidBody>(info));
  world_.addRigidBody(bodies_.back().get(), group, mask);
  return bodies_.back().get();
}

bool BulletPins::is_border(int cell) const { return w_.is_border(cell / w_.n, cell % w_.n); }

Eigen::Vector3d BulletPins::position(std::size_t object) const {
  const btVector3& p = objects_[object]->getWorldTransform().getOrigin();
  return Eigen::Vector3f(p.x(), p.y(), p.z()).cast<double>();
}

btVector3 BulletPins::pin_position(int cell, float height) const {
  const float half = is_border(cell) ? kHalfBorder : kHalfLength;
  return {static_cast<float>(cell % w_.n), static_cast<float>(w_.n - 1 - cell / w_.n), height - half};
}

void BulletPins::step(const std::vector<float>& heights) {
  for (int i = 0; i < w_.n * w_.n; ++i)
    if (!is_border(i)) pins_[i]->getWorldTransform().setOrigin(pin_position(i, heights[i]));
  world_.stepSimulation(static_cast<float>(kStepSeconds), 0);
}

void BulletPins::sense(const std::vector<float>& heights) {
  distance_.resize(heights.size());
  for (int i = 0; i < w_.n * w_.n; ++i) {
    const auto x = static_cast<float>(i % w_.n), y = static_cast<float>(w_.n - 1 - i / w_.n);
    const float z = heights[i];
    const btVector3 from(x, y, z + 1e-3F), to(x, y, z + static_cast<float>(kSensorRange));
    btCollisionWorld::ClosestRayResultCallback ray(from, to);
    ray.m_collisionFilterGroup = kRays;
    ray.m_collisionFilterMask = kObjects;
    world_.rayTest(from, to, ray);
    distance_[i] = ray.hasHit() ? ray.m_closestHitFraction * 4.0F : -1.0F;
  }
}
