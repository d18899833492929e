// MuJoCo as its documentation advises for scenes with many contacts: the CG solver, Euler (nothing is
// damped), constraint islands and multiccd; one mocap box per pin. A sensor is computed from the positions of
// the spheres, as a user of MuJoCo would, because a ray per pin searches all geoms. The pins of the workloads
// move vertically, so geom/surfacevel, which is tangential, does not apply.
#include "tests/bench/PinEngine.h"

#ifdef BENCH_MUJOCO

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <stdexcept>

#include "tests/peers/Mujoco.h"

using namespace pin_scene;

namespace {

constexpr double kHalfLength = 1.0;

std::string static_box(const Eigen::Vector3d& half, const Eigen::Vector3d& at) {
  return fmt::format(
      "<geom type='box' size='{} {} {}' pos='{} {} {}' contype='2' conaffinity='1' friction='.25 0 0'/>",
      half.x(), half.y(), half.z(), at.x(), at.y(), at.z());
}

// The hulls of a workload share few solids; each becomes one mesh.
std::string to_mjcf_meshes(const std::vector<smartsurf::scene::ObjectSpec>& objects,
                           std::map<const smartsurf::scene::Solid*, std::string>& names) {
  std::string out;
  for (const auto& o : objects) {
    if (!o.solid || names.contains(o.solid.get())) continue;
    const std::string name = fmt::format("hull{}", names.size());
    names[o.solid.get()] = name;
    out += fmt::format("<mesh name='{}' vertex='", name);
    for (const Eigen::Vector3f& v : o.solid->vertices) out += fmt::format("{} {} {} ", v.x(), v.y(), v.z());
    out += "'/>";
  }
  return out;
}

std::string to_geom(const smartsurf::scene::ObjectSpec& o,
                    const std::map<const smartsurf::scene::Solid*, std::string>& meshes) {
  using smartsurf::scene::ShapeKind;
  switch (o.shape) {
    case ShapeKind::kBox:
      return fmt::format("type='box' size='{} {} {}'", o.size.x() / 2, o.size.y() / 2, o.size.z() / 2);
    case ShapeKind::kCylinder:
      return fmt::format("type='cylinder' size='{} {}'", o.radius, o.height / 2);
    case ShapeKind::kSolid:
      return fmt::format("type='mesh' mesh='{}'", meshes.at(o.solid.get()));
    default:
      return fmt::format("type='sphere' size='{}'", o.radius);
  }
}

std::string to_mjcf(const Workload& w, const std::string& cone) {
  const auto objects = make_objects(w);
  std::map<const smartsurf::scene::Solid*, std::string> meshes;
  std::string out = fmt::format(
      "<mujoco><option timestep='{}' gravity='0 0 -10' solver='CG' cone='{}'>"
      "<flag island='enable' multiccd='enable'/></option><size memory='{}M'/><asset>{}</asset><worldbody>",
      kStepSeconds, cone, w.n * w.n / 8 + w.objects / 4, to_mjcf_meshes(objects, meshes));
  for (const Wall& wall : make_walls(w)) out += static_box(wall.half, wall.centre);
  for (int r = 0; r < w.n; ++r)
    for (int c = 0; c < w.n; ++c) {
      const double x = c, y = w.n - 1 - r;
      if (w.is_border(r, c))
        out += static_box({0.4, 0.4, 3.5}, {x, y, kBorderHeight - 3.5});
      else
        out += fmt::format("<body mocap='true' pos='{} {} {}'>", x, y, -kHalfLength) +
               static_box({0.4, 0.4, kHalfLength}, {0, 0, 0}) + "</body>";
    }
  for (const auto& o : objects)
    out += fmt::format(
        "<body pos='{} {} {}'><freejoint/><geom {} density='1' friction='.25 0 0' group='2'/></body>",
        o.position.x(), o.position.y(), o.position.z(), to_geom(o, meshes));
  return out + "</worldbody></mujoco>";
}

class MujocoPins final : public PinEngine {
 public:
  MujocoPins(const Workload& w, const std::string& cone)
      : w_(w), objects_(make_objects(w)), peer_(to_mjcf(w, cone)) {
    first_object_ = peer_.model().nbody - w.objects;
  }

  void step(const std::vector<float>& heights) override {
    mjtNum* z = peer_.data().mocap_pos + 2;
    for (int r = 1; r < w_.n - 1; ++r)
      for (int c = 1; c < w_.n - 1; ++c, z += 3) *z = heights[r * w_.n + c] - kHalfLength;
    peer_.step();
  }

  void sense(const std::vector<float>& heights) override {
    distance_.assign(heights.size(), -1.0);
    for (int i = 0; i < w_.objects; ++i) {
      const mjtNum* centre = peer_.position(first_object_ + i);
      const double radius = objects_[i].radius;
      const int first_y = first_cell(centre[1] - radius), end_y = end_cell(centre[1] + radius);
      const int first_x = first_cell(centre[0] - radius), end_x = end_cell(centre[0] + radius);
      for (int y = first_y; y < end_y; ++y)
        for (int x = first_x; x < end_x; ++x) {
          const double dx = x - centre[0], dy = y - centre[1], beside = dx * dx + dy * dy;
          if (beside > radius * radius) continue;
          const int cell = (w_.n - 1 - y) * w_.n + x;
          const double hit = centre[2] - std::sqrt(radius * radius - beside) - heights[cell];
          if (hit >= 0 && hit <= kSensorRange && (distance_[cell] < 0 || hit < distance_[cell]))
            distance_[cell] = hit;
        }
    }
  }

  Eigen::Vector3d position(std::size_t object) const override {
    return Eigen::Vector3d(peer_.position(first_object_ + static_cast<int>(object)));
  }

 private:
  int first_cell(double at) const { return std::max(0, static_cast<int>(std::ceil(at))); }
  int end_cell(double at) const { return std::min(w_.n, static_cast<int>(std::floor(at)) + 1); }

  Workload w_;
  std::vector<smartsurf::scene::ObjectSpec> objects_;
  peers::Mujoco peer_;
  int first_object_ = 0;
  std::vector<double> distance_;
};

}  // namespace

// The memory that it needs grows faster than the number of geoms: 1.1 GB for 128 x 128 pins.
std::unique_ptr<PinEngine> make_mujoco_pins(const Workload& w, const std::string& cone) {
  if (w.n > 128 || w.shapes != Shapes::kSpheres) return nullptr;
  try {
    return std::make_unique<MujocoPins>(w, cone);
  } catch (const std::runtime_error& refusal) {  // usually too little memory
    std::printf("%-18s %s\n", w.name().c_str(), refusal.what());
    return nullptr;
  }
}

#else

std::unique_ptr<PinEngine> make_mujoco_pins(const pin_scene::Workload&, const std::string&) {
  return nullptr;
}

#endif
