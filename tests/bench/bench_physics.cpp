// Compares World and its proximity sensors with naive Bullet, MuJoCo and ODE on the same scenes.
//
//   bench_physics [--steps N] [--only "64x64 100"] [--threads N] [--peers naive,mujoco,ode | none]
//     [--beside N] [--twin] [--json]
//
// Peers are single-threaded; they skip workloads that they do not support. MuJoCo and ODE are optional.
//
// Prints the median times of a 1/60 s step in milliseconds, the ratio of a peer's total to ours, and the
// accuracy: the largest overlap of two spheres and the deepest penetration of a sphere into a pin; in mixed
// scenes, ours also reports the penetration of the other shapes. "pins" is the time to move our pins and is
// not part of the total. --json prints one JSON object per line. --beside N runs N busy processes meanwhile,
// --twin a second process with the same workload: what two threads can reach at most on this machine.
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/ActuatorArray.h"
#include "smartsurf/surface/SensorArray.h"
#include "smartsurf/world/NativeEngine.h"
#include "tests/bench/BulletPins.h"
#include "tests/bench/CommandLine.h"
#include "tests/bench/ShapePenetration.h"
#include "tests/bench/Timing.h"

using namespace smartsurf;
using namespace pin_scene;

namespace {

struct Options {
  int steps = 120;
  int threads = 1;
  int beside = 0;
  bool twin = false;
  bool json = false;
  std::string only, peers = "naive,mujoco,ode";
  bool includes_peer(const char* peer) const { return peers.find(peer) != std::string::npos; }
};

struct Result {
  double physics_ms = 0, sensors_ms = 0, snapshot_ms = 0, pins_ms = 0, overlap = 0, penetration = 0,
         shape_penetration = 0;
  double physics_mean_ms = 0;  // of steps that change much, such as those of a growing heap
  int lost = 0, sleeping = 0;
  double wall_ms =
      0;              // mean of all measured steps; unlike the medians, it shows steps that waited for a core
  double cpu_ms = 0;  // processor time of a step, of all threads and with everything that belongs to it
  double physics_cpu_ms = 0;  // the same of the physics alone
  std::uint64_t state_hash = 0;
  double total_ms() const { return physics_ms + sensors_ms; }
};

// Processes that repeat `work` until the end of the scope.
class Processes {
 public:
  Processes(int count, const std::function<void()>& work) {
    for (int i = 0; i < count; ++i) {
      const pid_t child = ::fork();
      if (child == 0) {
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        for (;;) work();
      }
      if (child > 0) children_.push_back(child);
    }
  }
  ~Processes() {
    for (const pid_t child : children_) {
      ::kill(child, SIGKILL);
      ::waitpid(child, nullptr, 0);
    }
  }
  Processes(const Processes&) = delete;
  Processes& operator=(const Processes&) = delete;

 private:
  std::vector<pid_t> children_;
};

void keep_busy() {
  const volatile bool busy = true;
  while (busy) {
  }
}

struct Sphere {
  Eigen::Vector3d centre;
  double radius;
};

double sphere_penetration(const Workload& w, const Sphere& b, const std::vector<float>& heights) {
  double deepest = 0;
  auto cell = [&w](double at) { return std::clamp(static_cast<int>(at), 0, w.n - 1); };
  for (int y = cell(b.centre.y() - b.radius); y <= cell(b.centre.y() + b.radius + 1); ++y)
    for (int x = cell(b.centre.x() - b.radius); x <= cell(b.centre.x() + b.radius + 1); ++x) {
      const double top = heights[(w.n - 1 - y) * w.n + x];
      const Eigen::Vector3d gap(std::max(0.0, std::abs(b.centre.x() - x) - 0.4),
                                std::max(0.0, std::abs(b.centre.y() - y) - 0.4),
                                std::max(0.0, b.centre.z() - top));
      deepest = std::max(deepest, b.radius - gap.norm());
    }
  return deepest;
}

// Considers spheres only. Spheres outside the table count as lost.
void measure_accuracy(const Workload& w, std::vector<Sphere> spheres, const std::vector<float>& heights,
                      Result& out) {
  std::sort(spheres.begin(), spheres.end(),
            [](const Sphere& a, const Sphere& b) { return a.centre.x() < b.centre.x(); });
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const Sphere& a = spheres[i];
    if (a.centre.z() < 0 || a.centre.x() < -1 || a.centre.x() > w.n || a.centre.y() < -1 ||
        a.centre.y() > w.n) {
      ++out.lost;
      continue;
    }
    out.penetration = std::max(out.penetration, sphere_penetration(w, a, heights));
    for (std::size_t j = i + 1; j < spheres.size() && spheres[j].centre.x() - a.centre.x() < 6; ++j)
      out.overlap =
          std::max(out.overlap, a.radius + spheres[j].radius - (a.centre - spheres[j].centre).norm());
  }
}

// Considers non-spheres only.
double worst_shape_penetration(const Workload& w, const scene::SceneSpec& spec,
                               const scene::Snapshot& snapshot) {
  double deepest = 0;
  for (int i = 0; i < w.objects; ++i) {
    if (spec.objects[i].shape == scene::ShapeKind::kSphere) continue;
    const auto& q = snapshot.orientation[i];
    deepest = std::max(
        deepest,
        max_shape_penetration(w, world::make_shape(spec.objects[i]), world::Vec3(snapshot.position[i].data()),
                              world::Quat(q[3], q[0], q[1], q[2]).toRotationMatrix(), snapshot.height));
  }
  return deepest;
}

struct StageTimes {
  std::vector<double> physics, sensors, snapshot, pins;
};

Result run_smartsurf(const Workload& w, const Options& options) {
  scene::SceneSpec spec = make_scene(w);
  spec.surface.sensors = {scene::find_sensor_kind("proximity")->default_spec()};
  spec.surface.sensors[0].values["range"] = {kSensorRange};
  common::ThreadPool pool(options.threads);
  surface::ActuatorArray cells(spec.surface, {}, 1, &pool);
  world::NativeEngine world(spec, cells.field(), &pool);
  surface::SensorArray sensing(spec, cells.field());
  scene::Snapshot snapshot;
  std::vector<float> targets;
  StageTimes times;
  const int settling_count = settling_steps(w);
  double wall_ms = 0, cpu_ms = 0, physics_cpu_ms = 0;
  for (int i = 0; i < settling_count + options.steps; ++i) {
    compute_targets(w, i * kStepSeconds, targets);  // the controller's work
    const auto start = std::chrono::steady_clock::now();
    const double cpu_start = bench::processor_ms();
    const double plan = bench::elapsed_ms([&] {
      cells.set_targets(0, targets);
      cells.plan(kStepSeconds);
    });
    const double cpu_before = bench::processor_ms();
    const double physics = bench::elapsed_ms([&] { world.step(); });
    if (i >= settling_count) physics_cpu_ms += bench::processor_ms() - cpu_before;
    const double commit = bench::elapsed_ms([&] { cells.commit(kStepSeconds); });
    const double snapshot_time = bench::elapsed_ms([&] { world.snapshot(snapshot, true); });
    const double sensors = bench::elapsed_ms([&] { sensing.sense(snapshot, spec.objects, pool); });
    if (i < settling_count) continue;
    cpu_ms += bench::processor_ms() - cpu_start;
    wall_ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    times.physics.push_back(physics);
    times.sensors.push_back(sensors);
    times.snapshot.push_back(snapshot_time);
    times.pins.push_back(plan + commit);
  }
  Result r{bench::median(times.physics), bench::median(times.sensors), bench::median(times.snapshot),
           bench::median(times.pins)};
  r.cpu_ms = cpu_ms / options.steps;
  r.wall_ms = wall_ms / options.steps;
  r.physics_cpu_ms = physics_cpu_ms / options.steps;
  r.physics_mean_ms = std::accumulate(times.physics.begin(), times.physics.end(), 0.0) / options.steps;
  r.state_hash = snapshot.state_hash;
  r.sleeping = world.sleeping_count();
  std::vector<Sphere> spheres;
  for (int i = 0; i < w.objects; ++i)
    if (spec.objects[i].shape == scene::ShapeKind::kSphere)
      spheres.push_back(
          {Eigen::Vector3f(snapshot.position[i].data()).cast<double>(), spec.objects[i].radius});
  measure_accuracy(w, spheres, snapshot.height, r);
  r.shape_penetration = worst_shape_penetration(w, spec, snapshot);
  return r;
}

// Measures fewer steps, but at least six, if a step takes long.
Result run_peer(PinEngine& peer, const Workload& w, const Options& options) {
  const scene::SceneSpec spec = make_scene(w);
  surface::ActuatorArray cells(spec.surface);
  std::vector<float> targets, heights;
  StageTimes times;
  const int settling_count = settling_steps(w);
  double spent_ms = 0, cpu_ms = 0;
  for (int i = 0; i < settling_count + options.steps && (i <= settling_count + 5 || spent_ms < 12e3); ++i) {
    compute_targets(w, i * kStepSeconds, targets);
    const double cpu_start = bench::processor_ms();
    cells.set_targets(0, targets);
    cells.plan(kStepSeconds);
    cells.commit(kStepSeconds);
    heights = cells.field().height;
    const double physics = bench::elapsed_ms([&] { peer.step(heights); });
    if (i < settling_count) continue;
    times.physics.push_back(physics);
    times.sensors.push_back(bench::elapsed_ms([&] { peer.sense(heights); }));
    cpu_ms += bench::processor_ms() - cpu_start;
    spent_ms += physics + times.sensors.back();
  }
  Result r{bench::median(times.physics), bench::median(times.sensors)};
  r.cpu_ms = cpu_ms / static_cast<double>(times.physics.size());
  std::vector<Sphere> spheres;
  for (int i = 0; i < w.objects; ++i)
    if (spec.objects[i].shape == scene::ShapeKind::kSphere)
      spheres.push_back({peer.position(i), spec.objects[i].radius});
  measure_accuracy(w, spheres, heights, r);
  return r;
}

void report(const char* who, const Workload& w, const Result& r) {
  std::printf("%-18s %-16s physics %8.3f  sensors %7.3f  total %8.3f ms  overlap %.4f  pins %.4f  lost %d",
              w.name().c_str(), who, r.physics_ms, r.sensors_ms, r.total_ms(), r.overlap, r.penetration,
              r.lost);
}

void report_json(const char* who, const Workload& w, const Options& options, const Result& r) {
  const nlohmann::ordered_json line{{"benchmark", "physics"},
                                    {"case", w.name()},
                                    {"who", who},
                                    {"threads", who == std::string("ours") ? options.threads : 1},
                                    {"physics_ms", r.physics_ms},
                                    {"physics_mean_ms", r.physics_mean_ms},
                                    {"sensors_ms", r.sensors_ms},
                                    {"cpu_ms", r.cpu_ms},
                                    {"physics_cpu_ms", r.physics_cpu_ms},
                                    {"asleep", r.sleeping},
                                    {"state_hash", fmt::format("{:016x}", r.state_hash)},
                                    {"overlap_u", r.overlap},
                                    {"in_pins_u", r.penetration},
                                    {"shapes_in_pins_u", r.shape_penetration},
                                    {"lost", r.lost},
                                    {"beside", options.beside},
                                    {"twin", options.twin},
                                    {"wall_ms", r.wall_ms}};
  std::puts(line.dump().c_str());
  std::fflush(stdout);
}

void compare(const char* who, PinEngine& peer, const Workload& w, const Options& options,
             const Result& ours) {
  const Result theirs = run_peer(peer, w, options);
  if (options.json) return report_json(who, w, options, theirs);
  report(who, w, theirs);
  std::printf("  × %.1f\n", theirs.total_ms() / ours.total_ms());
  std::fflush(stdout);
}

void run(const Workload& w, const Options& options) {
  const Result ours = run_smartsurf(w, options);
  if (options.json) {
    report_json("ours", w, options, ours);
  } else {
    report("ours", w, ours);
    if (w.shapes != Shapes::kSpheres) std::printf("  shapes in pins %.4f", ours.shape_penetration);
    std::printf("  snapshot %.3f  pins %.3f ms  asleep %d  wall %.3f ms\n", ours.snapshot_ms, ours.pins_ms,
                ours.sleeping, ours.wall_ms);
    std::fflush(stdout);
  }
  if (w.n > 256 || w.field != Field::kWave) return;
  if (options.includes_peer("naive")) {
    BulletPins naive(w);
    compare("naive", naive, w, options, ours);
  }
  if (options.includes_peer("mujoco"))
    for (const std::string cone : {"pyramidal", "elliptic"})
      if (const auto mujoco = make_mujoco_pins(w, cone))
        compare(("MuJoCo " + cone).c_str(), *mujoco, w, options, ours);
  if (options.includes_peer("ode"))
    if (const auto ode = make_ode_pins(w)) compare("ODE", *ode, w, options, ours);
}

const std::vector<Workload>& workloads() {
  using enum Shapes;
  using enum Field;
  static const std::vector<Workload> kWorkloads{
      {64, 100, kSpheres, kWave},         {64, 1000, kSpheres, kWave},
      {128, 1000, kSpheres, kWave},       {128, 5000, kSpheres, kWave},
      {256, 10000, kSpheres, kWave},      {1024, 10000, kSpheres, kWave},
      {128, 1000, kHalfMixed, kWave},     {128, 5000, kHalfMixed, kWave},
      {128, 3000, kBoxes, kWave},         {64, 2000, kBoxes, kHeap},
      {156, 2028, kBoxes, kTowers},       {156, 2028, kBoxes, kAsleep},
      {156, 1752, kBoxes, kBeside},       {128, 5000, kSpheres, kStill},
      {1024, 10000, kSpheres, kFalling},  {2048, 40000, kSpheres, kFalling},
      {4096, 100000, kSpheres, kFalling},
  };
  return kWorkloads;
}

Options read_options(int argc, char** argv) {
  Options o;
  std::vector<std::string> peers;
  CLI::App app("Compares the physics and proximity sensors with other engines", "bench_physics");
  app.add_option("--steps", o.steps, "measured steps")->check(CLI::Range(1, 1'000'000));
  app.add_option("--threads", o.threads, "threads of our engine")->check(CLI::Range(1, 1024));
  app.add_option("--only", o.only, "one workload, such as \"64x64 100\"")
      ->check(bench::one_of(workloads(), [](const Workload& w) { return w.name(); }));
  app.add_option("--peers", peers, "naive,mujoco,ode or none")
      ->delimiter(',')
      ->check(CLI::IsMember({"naive", "mujoco", "ode", "none"}));
  app.add_option("--beside", o.beside, "busy processes that compete for the cores")
      ->check(CLI::Range(0, 1024));
  app.add_flag("--twin", o.twin, "a second process runs the same workload");
  app.add_flag("--json", o.json, "print one JSON object per line");
  bench::parse_or_exit(app, argc, argv);
  if (!peers.empty()) o.peers = CLI::detail::join(peers);
  return o;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = read_options(argc, argv);
  const Processes competitors(options.beside, keep_busy);
  for (const Workload& w : workloads()) {
    if (!options.only.empty() && w.name() != options.only) continue;
    const Processes twin(options.twin ? 1 : 0, [&] { run_smartsurf(w, options); });
    run(w, options);
  }
}
