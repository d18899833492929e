// MuJoCo's newest version with its default solver (Newton), implicitfast, constraint islands and multiccd: one
// mocap box per pin and one ray per sensor. The pins of the workloads move vertically, so geom/surfacevel, which
// is tangential, does not apply.
#include "tests/bench/PinEngine.h"

#ifdef BENCH_MUJOCO

#include <fmt/format.h>

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

std::string to_mjcf(const Workload& w) {
  const auto objects = make_objects(w);
  std::map<const smartsurf::scene::Solid*, std::string> meshes;
  std::string out = fmt::format(
      "<mujoco><option timestep='{}' gravity='0 0 -10' integrator='implicitfast'>"
      "<flag island='enable' multiccd='enable'/></option><size memory='{}M'/><asset>{}</asset><worldbody>",
      kStepSeconds, w.n * w.n / 8 + w.objects / 4, to_mjcf_meshes(objects, meshes));
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
  explicit MujocoPins(const Workload& w) : w_(w), peer_(to_mjcf(w)) {
    first_object_ = peer_.model().nbody - w.objects;
  }

  void step(const std::vector<float>& heights) override {
    mjtNum* z = peer_.data().mocap_pos + 2;
    for (int r = 1; r < w_.n - 1; ++r)
      for (int c = 1; c < w_.n - 1; ++c, z += 3)
        *z = static_cast<double>(heights[static_cast<std::size_t>(r * w_.n + c)]) - kHalfLength;
    peer_.step();
  }

  void sense(const std::vector<float>& heights) override {
    const mjtByte groups[mjNGROUP] = {0, 0, 1, 0, 0, 0};
    const mjtNum up[3] = {0, 0, 1};
    distance_.resize(heights.size());
    for (int i = 0; i < w_.n * w_.n; ++i) {
      const auto cell = static_cast<std::size_t>(i);
      const mjtNum from[3] = {static_cast<double>(i % w_.n), static_cast<double>(w_.n - 1 - i / w_.n),
                              static_cast<double>(heights[cell]) + 1e-3};
      int geom = -1;
      const mjtNum hit_distance =
          mj_ray(&peer_.model(), &peer_.data(), from, up, groups, 0, -1, &geom, nullptr);
      distance_[cell] = hit_distance <= kSensorRange ? hit_distance : -1.0;
    }
  }

  Eigen::Vector3d position(std::size_t object) const override {
    return Eigen::Vector3d(peer_.position(first_object_ + static_cast<int>(object)));
  }

 private:
  Workload w_;
  peers::Mujoco peer_;
  int first_object_ = 0;
  std::vector<double> distance_;
};

}  // namespace

// The memory that it needs grows faster than the number of geoms: 1.1 GB for 128 x 128 pins.
std::unique_ptr<PinEngine> make_mujoco_pins(const Workload& w) {
  if (w.n > 128) return nullptr;
  try {
    return std::make_unique<MujocoPins>(w);
  } catch (const std::runtime_error& refusal) {  // usually too little memory
    std::printf("%-18s %s\n", w.name().c_str(), refusal.what());
    return nullptr;
  }
}

#else

std::unique_ptr<PinEngine> make_mujoco_pins(const pin_scene::Workload&) { return nullptr; }

#endif
