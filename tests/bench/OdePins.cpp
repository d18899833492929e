// ODE with its iterative solver: one static box per pin, whose speed is set at its contacts, and one ray per
// sensor.
#include "tests/bench/PinEngine.h"

#ifdef BENCH_ODE

#include <ode/ode.h>

using namespace pin_scene;

namespace {

constexpr double kHalfLength = 1.0;

struct OdeLibrary {
  OdeLibrary() { dInitODE2(0); }
  ~OdeLibrary() { dCloseODE(); }
};

class OdePins final : public PinEngine {
 public:
  explicit OdePins(const Workload& w) : w_(w), speed_(pins(), 0.0), previous_heights_(pins(), 0.0F) {
    dWorldSetGravity(world_, 0, 0, -10);
    dWorldSetQuickStepNumIterations(world_, 10);
    dWorldSetContactSurfaceLayer(world_, 0.001);
    const double middle = (w.n - 1) * 0.5;
    const dVector3 centre = {middle, middle, 0, 0}, half = {w.n * 0.5 + 4, w.n * 0.5 + 4, 200, 0};
    const int depth = static_cast<int>(std::log2(w.n)) - 2;
    field_ = dQuadTreeSpaceCreate(nullptr, centre, half, depth);
    objects_ = dQuadTreeSpaceCreate(nullptr, centre, half, depth);
    walls_ = dSimpleSpaceCreate(nullptr);
    for (std::size_t i = 0; i < pins(); ++i) add_pin(static_cast<int>(i));
    for (const Wall& wall : make_walls(w))
      set_position(dCreateBox(walls_, 2 * wall.half.x(), 2 * wall.half.y(), 2 * wall.half.z()), wall.centre);
    for (const auto& o : pin_scene::make_objects(w)) add_sphere(o);
    ray_ = dCreateRay(nullptr, kSensorRange);
  }

  ~OdePins() override {
    dGeomDestroy(ray_);
    for (dSpaceID space : {field_, objects_, walls_}) dSpaceDestroy(space);
    dJointGroupDestroy(contacts_);
    dWorldDestroy(world_);
  }
  OdePins(const OdePins&) = delete;
  OdePins& operator=(const OdePins&) = delete;

  void step(const std::vector<float>& heights) override {
    for (std::size_t i = 0; i < pins(); ++i) {
      if (is_border(static_cast<int>(i))) continue;
      speed_[i] =
          (static_cast<double>(heights[i]) - static_cast<double>(previous_heights_[i])) / kStepSeconds;
      previous_heights_[i] = heights[i];
      set_position(pins_[i], pin_position(static_cast<int>(i), static_cast<double>(heights[i])) -
                                 Eigen::Vector3d(0, 0, kHalfLength));
    }
    auto* objects = reinterpret_cast<dGeomID>(objects_);
    dSpaceCollide(objects_, this, &near_callback);
    dSpaceCollide2(objects, reinterpret_cast<dGeomID>(field_), this, &near_callback);
    dSpaceCollide2(objects, reinterpret_cast<dGeomID>(walls_), this, &near_callback);
    dWorldQuickStep(world_, kStepSeconds);
    dJointGroupEmpty(contacts_);
  }

  void sense(const std::vector<float>& heights) override {
    distance_.resize(pins());
    for (std::size_t i = 0; i < pins(); ++i) {
      const Eigen::Vector3d from = pin_position(static_cast<int>(i), static_cast<double>(heights[i]) + 1e-3);
      dGeomRaySet(ray_, from.x(), from.y(), from.z(), 0, 0, 1);
      distance_[i] = kSensorRange;
      dSpaceCollide2(ray_, reinterpret_cast<dGeomID>(objects_), &distance_[i], &ray_callback);
    }
  }

  Eigen::Vector3d position(std::size_t object) const override {
    return Eigen::Vector3d(dBodyGetPosition(bodies_[object]));
  }

 private:
  std::size_t pins() const { return static_cast<std::size_t>(w_.n) * static_cast<std::size_t>(w_.n); }
  bool is_border(int cell) const { return w_.is_border(cell / w_.n, cell % w_.n); }
  Eigen::Vector3d pin_position(int cell, double z) const {
    return {cell % w_.n + 0.0, w_.n - 1.0 - cell / w_.n, z};
  }
  static void set_position(dGeomID geom, const Eigen::Vector3d& at) {
    dGeomSetPosition(geom, at.x(), at.y(), at.z());
  }

  void add_pin(int cell) {
    const double half = is_border(cell) ? 3.5 : kHalfLength, height = is_border(cell) ? kBorderHeight : 0.0;
    pins_.push_back(dCreateBox(field_, 0.8, 0.8, 2 * half));
    set_position(pins_.back(), pin_position(cell, height - half));
    dGeomSetData(pins_.back(), &speed_[cell]);
  }

  void add_sphere(const smartsurf::scene::ObjectSpec& o) {
    const dBodyID body = bodies_.emplace_back(dBodyCreate(world_));
    dMass mass;
    dMassSetSphere(&mass, 1, o.radius);
    dBodySetMass(body, &mass);
    dBodySetPosition(body, o.position.x(), o.position.y(), o.position.z());
    dGeomSetBody(dCreateSphere(objects_, o.radius), body);
  }

  static void near_callback(void* self, dGeomID a, dGeomID b) {
    auto& pins = *static_cast<OdePins*>(self);
    dContact contact[4];
    const int found = dCollide(a, b, 4, &contact[0].geom, sizeof(dContact));
    const void* speed = dGeomGetBody(a) ? dGeomGetData(b) : dGeomGetData(a);
    for (int i = 0; i < found; ++i) {
      contact[i].surface.mode = dContactApprox1;
      contact[i].surface.mu = 0.25;
      if (speed) {
        contact[i].surface.mode |= dContactMotionN;
        contact[i].surface.motionN = *static_cast<const double*>(speed) * contact[i].geom.normal[2];
      }
      dJointAttach(dJointCreateContact(pins.world_, pins.contacts_, &contact[i]), dGeomGetBody(a),
                   dGeomGetBody(b));
    }
  }

  static void ray_callback(void* nearest, dGeomID a, dGeomID b) {
    dContactGeom hit;
    if (dCollide(a, b, 1, &hit, sizeof(hit)))
      *static_cast<double*>(nearest) =
          std::min(*static_cast<double*>(nearest), static_cast<double>(hit.depth));
  }

  OdeLibrary library_;
  Workload w_;
  std::vector<double> speed_, distance_;
  std::vector<float> previous_heights_;
  dWorldID world_ = dWorldCreate();
  dJointGroupID contacts_ = dJointGroupCreate(0);
  dSpaceID field_ = nullptr, objects_ = nullptr, walls_ = nullptr;
  std::vector<dGeomID> pins_;
  std::vector<dBodyID> bodies_;
  dGeomID ray_ = nullptr;
};

}  // namespace

std::unique_ptr<PinEngine> make_ode_pins(const Workload& w) {
  if (w.shapes != Shapes::kSpheres || w.n > 256) return nullptr;
  return std::make_unique<OdePins>(w);
}

#else

std::unique_ptr<PinEngine> make_ode_pins(const pin_scene::Workload&) { return nullptr; }

#endif
