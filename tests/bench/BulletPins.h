// The baseline: a straightforward pin surface in Bullet with one kinematic box per pin and one ray per
// sensor.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <memory>
#include <vector>

#include "tests/bench/PinEngine.h"

class BulletPins final : public PinEngine {
 public:
  explicit BulletPins(const pin_scene::Workload& w);
  ~BulletPins() override;

  void step(const std::vector<float>& heights) override;
  void sense(const std::vector<float>& heights) override;
  Eigen::Vector3d position(std::size_t object) const override;

 private:
  btRigidBody* add(btCollisionShape*, const btVector3& at, float mass, int group, int mask);
  bool is_border(int cell) const;
  btVector3 pin_position(int cell, float height) const;

  pin_scene::Workload w_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  btDiscreteDynamicsWorld world_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<btRigidBody*> pins_, objects_;
  std::vector<float> distance_;
};
