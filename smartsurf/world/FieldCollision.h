// The field of pins as one collision object in Bullet's world.
#pragma once

#include <btBulletDynamicsCommon.h>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::world {

// What a body's user pointer refers to.
struct BodyTag {
  scene::ObjectSpec spec;
  scene::ObjectId id;
};

// Marks a manifold point as one with the field: m_partId1 holds the tag, m_index1 the cell.
inline constexpr int kFieldPart = 0x50494e53;

// A shape without triangles: contacts come from find_field_contacts().
class FieldShape final : public btConcaveShape {
 public:
  // Contacts may be asked for up to `max_height` above the origin and down to `floor`.
  FieldShape(const surface::Field&, float floor, float max_height, float dt_s);

  const surface::Field& field() const { return field_; }
  float dt_s() const { return dt_s_; }

  void getAabb(const btTransform&, btVector3& low, btVector3& high) const override;
  void processAllTriangles(btTriangleCallback*, const btVector3&, const btVector3&) const override {}
  void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setZero(); }
  void setLocalScaling(const btVector3&) override {}
  const btVector3& getLocalScaling() const override { return scaling_; }
  const char* getName() const override { return "Field"; }

 private:
  const surface::Field& field_;
  float dt_s_;
  btVector3 low_, high_;
  btVector3 scaling_{1, 1, 1};
};

// Sends the pairs of a convex body and the field to find_field_contacts().
void register_field_collision(btCollisionDispatcher&);
// To size Bullet's pool of collision algorithms.
int field_algorithm_size();

}  // namespace smartsurf::world
