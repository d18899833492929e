#include "smartsurf/world/FieldCollision.h"

#include <BulletCollision/CollisionDispatch/btActivatingCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>

#include <algorithm>

#include "smartsurf/world/BulletShapes.h"
#include "smartsurf/world/FieldContacts.h"

namespace smartsurf::world {
namespace {

// Contacts this near are kept even when nothing moves, so that resting contacts do not flicker.
constexpr float kRestMargin = 0.02F;

class FieldAlgorithm final : public btActivatingCollisionAlgorithm {
 public:
  FieldAlgorithm(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* a,
                 const btCollisionObjectWrapper* b, bool field_first)
      : btActivatingCollisionAlgorithm(info, a, b), field_first_(field_first) {
    const auto* body = (field_first ? b : a)->getCollisionObject();
    const auto* field = (field_first ? a : b)->getCollisionObject();
    manifold_ = m_dispatcher->getNewManifold(body, field);
  }
  ~FieldAlgorithm() override { m_dispatcher->releaseManifold(manifold_); }

  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, const btDispatcherInfo&,
                        btManifoldResult*) override {
    const auto* body = btRigidBody::upcast((field_first_ ? b : a)->getCollisionObject());
    const auto* field_object = (field_first_ ? a : b)->getCollisionObject();
    const auto& shape = static_cast<const FieldShape&>(*field_object->getCollisionShape());
    const auto& tag = *static_cast<const BodyTag*>(body->getUserPointer());
    const auto& convex = static_cast<const btConvexShape&>(*body->getCollisionShape());
    const btTransform& pose = body->getWorldTransform();

    // Speculative: everything that body and pins can reach within the step.
    const auto reach = static_cast<float>(tag.spec.half_extents().norm());
    const float approach = body->getLinearVelocity().length() + shape.field().max_speed +
                           (tag.spec.shape == scene::ShapeKind::kSphere ? 0.0F
                                                                        : body->getAngularVelocity().length() * reach);
    const float margin = std::max(kRestMargin, approach * shape.dt_s());
    store(find_field_contacts(shape.field(), tag.spec, convex, pose, margin), pose, combine(*body, *field_object));
  }

  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1;
  }
  void getAllContactManifolds(btManifoldArray& out) override { out.push_back(manifold_); }

 private:
  // Replaces the manifold's points, carrying over the impulses of cells that still touch: they start the solver warm.
  void store(const FieldContactSet& set, const btTransform& pose, const CombinedMaterial& material) {
    btManifoldPoint old[4];
    const int old_count = manifold_->getNumContacts();
    for (int i = 0; i < old_count; ++i) old[i] = manifold_->getContactPoint(i);
    manifold_->setNumContacts(set.count);
    for (int i = 0; i < set.count; ++i) {
      const FieldContact& c = set.contact[static_cast<std::size_t>(i)];
      const btVector3 on_body = c.point + c.normal * c.distance;
      btManifoldPoint p(pose.invXform(on_body), c.point, c.normal, c.distance);
      p.m_positionWorldOnA = on_body;
      p.m_positionWorldOnB = c.point;
      p.m_combinedFriction = material.friction;
      p.m_combinedRestitution = material.restitution;
      p.m_combinedRollingFriction = material.rolling_friction;
      p.m_combinedSpinningFriction = material.rolling_friction;
      p.m_partId1 = kFieldPart;
      p.m_index1 = c.cell;
      for (int j = 0; j < old_count; ++j)
        if (old[j].m_index1 == c.cell && old[j].m_normalWorldOnB.dot(c.normal) > 0.9F) {
          p.m_appliedImpulse = old[j].m_appliedImpulse;
          break;
        }
      manifold_->getContactPoint(i) = p;
    }
  }

  btPersistentManifold* manifold_;
  bool field_first_;
};

class FieldAlgorithmCreator final : public btCollisionAlgorithmCreateFunc {
 public:
  explicit FieldAlgorithmCreator(bool field_first) : field_first_(field_first) {}
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* a,
                                                 const btCollisionObjectWrapper* b) override {
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(FieldAlgorithm));
    return new (memory) FieldAlgorithm(info, a, b, field_first_);
  }

 private:
  bool field_first_;
};

FieldAlgorithmCreator body_then_field(false), field_then_body(true);

}  // namespace

FieldShape::FieldShape(const surface::Field& field, float floor, float max_height, float dt_s)
    : field_(field), dt_s_(dt_s) {
  m_shapeType = CUSTOM_CONCAVE_SHAPE_TYPE;
  const auto pitch = field.pitch;
  low_.setValue(-0.5F * pitch, -0.5F * pitch, floor);
  high_.setValue((static_cast<float>(field.columns) - 0.5F) * pitch,
                 (static_cast<float>(field.rows) - 0.5F) * pitch, max_height);
}

void FieldShape::getAabb(const btTransform&, btVector3& low, btVector3& high) const {
  low = low_;
  high = high_;
}

void register_field_collision(btCollisionDispatcher& dispatcher) {
  for (const int convex : {SPHERE_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, CYLINDER_SHAPE_PROXYTYPE}) {
    dispatcher.registerCollisionCreateFunc(convex, CUSTOM_CONCAVE_SHAPE_TYPE, &body_then_field);
    dispatcher.registerCollisionCreateFunc(CUSTOM_CONCAVE_SHAPE_TYPE, convex, &field_then_body);
  }
}

int field_algorithm_size() { return static_cast<int>(sizeof(FieldAlgorithm)); }

}  // namespace smartsurf::world
