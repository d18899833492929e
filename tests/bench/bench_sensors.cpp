// Benchmarks each sensor model on surfaces of increasing size, and the proximity sensor against brute force
// (every ray against every object).
//
//   bench_sensors [--only "256x256 10000"] [--model proximity] [--repeats N] [--threads N] [--no-peer]
//                 [--json]
//
// Prints the median time of one sense() in milliseconds, and for proximity the slowdown and the maximum
// difference of brute force. --json prints one JSON object per line.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <string>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/SensorArray.h"
#include "tests/bench/CommandLine.h"
#include "tests/bench/Timing.h"

using namespace smartsurf;

namespace {

struct Options {
  std::string only, model;
  int repeats = 61, threads = 1;
  bool peer = true, json = false;
};

struct Workload {
  int n, objects;
  bool mixed;
  std::string name() const {
    return std::to_string(n) + "x" + std::to_string(n) + " " + std::to_string(objects) +
           (mixed ? " mixed" : "");
  }
};

struct Scene {
  scene::SceneSpec spec;
  surface::Field field;
  scene::Snapshot snapshot;
};

// Places the objects as after settling: about 2 u above a wave, in as many layers as needed. In mixed
// workloads, every other object is a box, cylinder, capsule or cone.
Scene scene_of(const Workload& w) {
  Scene s;
  s.spec.surface.rows = s.spec.surface.columns = s.field.rows = s.field.columns = w.n;
  for (int i = 0; i < w.n * w.n; ++i)
    s.snapshot.height.push_back(1.0F + std::sin(0.3F * static_cast<float>(i % w.n)));
  s.field.height = s.snapshot.height;
  std::mt19937 random(12345);
  std::uniform_real_distribution<double> u(0, 1);
  const double a_layer = w.n * w.n / 20.0;
  for (int k = 0; k < w.objects; ++k) {
    scene::ObjectSpec o;
    o.radius = 1.5 + 1.5 * u(random);
    const double lift = 4.5 * std::floor(k / a_layer);
    o.position = {w.n * u(random), w.n * u(random), 1.0 + o.radius + u(random) + lift};
    o.orientation = Eigen::AngleAxisd(u(random) * 6, Eigen::Vector3d(u(random), 1, u(random)).normalized());
    if (w.mixed && k % 2 == 1) {
      constexpr scene::ShapeKind kKinds[] = {scene::ShapeKind::kBox, scene::ShapeKind::kCylinder,
                                             scene::ShapeKind::kCapsule, scene::ShapeKind::kCone};
      o.shape = kKinds[k / 2 % 4];
      o.size = Eigen::Vector3d(1.2, 1.6, 1.0) * o.radius;
      o.radius *= 0.7;
      o.height = 2.2 * o.radius;
    }
    const auto p = o.position.cast<float>();
    const auto q = o.orientation.cast<float>();
    s.snapshot.id.push_back(static_cast<scene::ObjectId>(k));
    s.snapshot.position.push_back({p.x(), p.y(), p.z()});
    s.snapshot.orientation.push_back({q.x(), q.y(), q.z(), q.w()});
    s.spec.objects.push_back(std::move(o));
  }
  return s;
}

// Moves every object slightly, so that no two casts give the same result.
void jitter_objects(Scene& s, int step) {
  for (std::size_t k = 0; k < s.snapshot.position.size(); ++k)
    s.snapshot.position[k][0] += ((k + static_cast<std::size_t>(step)) % 2 == 0) ? 0.05F : -0.05F;
}

struct Model {
  std::string label, kind;
  scene::ParameterValues values;
};

const Model kModels[] = {
    {"proximity", "proximity", {{"range", {4}}}},
    {"proximity aslant", "proximity", {{"range", {4}}, {"direction", {1, 0, 0.3}}}},
    {"proximity level", "proximity", {{"range", {8}}, {"direction", {1, 0.5, 0}}, {"origin", {0, 0, 0.2}}}},
    {"proximity noisy", "proximity", {{"range", {4}}, {"noise", {0.05}}, {"quantize", {0.01}}}},
    {"colour", "colour", {{"range", {4}}}},
    {"object_type", "object_type", {{"range", {4}}}},
    {"light", "light", {{"direction", {1, 0, 1}}, {"range", {50}}}},
    {"pressure", "pressure", {}},
    {"camera", "camera", {}},
};

double run_model(Scene& s, const Model& model, const Options& options, common::ThreadPool& pool) {
  s.spec.surface.sensors = {scene::find_sensor_kind(model.kind)->default_spec()};
  for (const auto& [name, value] : model.values) s.spec.surface.sensors[0].values[name] = value;
  surface::SensorArray sensors(s.spec, s.field);
  const std::vector<float> impulse(s.snapshot.height.size(), 0.01F);
  std::vector<double> times;
  for (int i = 0; i < options.repeats; ++i) {
    jitter_objects(s, i);
    times.push_back(bench::elapsed_ms([&] {
      sensors.accumulate_impulses(impulse);
      sensors.sense(s.snapshot, s.spec.objects, pool);
    }));
  }
  return bench::median(times);
}

// Brute force for spheres and vertical rays.
double brute_force_distance(const Scene& s, int cell, double range) {
  const double x = cell % s.field.columns, y = s.field.rows - 1 - cell / s.field.columns;
  const double z = s.snapshot.height[cell];
  double best = range;
  for (std::size_t k = 0; k < s.snapshot.position.size(); ++k) {
    const auto& p = s.snapshot.position[k];
    const double dx = p[0] - x, dy = p[1] - y, r = s.spec.objects[k].radius;
    const double square = r * r - dx * dx - dy * dy;
    if (square < 0) continue;
    const double half = std::sqrt(square);
    if (p[2] + half >= z) best = std::min(best, std::max(0.0, p[2] - half - z));
  }
  return best;
}

void print_json(const Workload& w, const std::string& who, double ms) {
  const nlohmann::ordered_json line{
      {"benchmark", "sensors"}, {"case", w.name()}, {"who", who}, {"median_ms", ms}};
  std::puts(line.dump().c_str());
  std::fflush(stdout);
}

void compare(Scene& s, const Workload& w, double ours_ms, bool json, common::ThreadPool& pool) {
  s.spec.surface.sensors = {scene::find_sensor_kind("proximity")->default_spec()};
  s.spec.surface.sensors[0].values["range"] = {4};
  surface::SensorArray sensors(s.spec, s.field);
  sensors.sense(s.snapshot, s.spec.objects, pool);
  const int cells = s.field.cells(), stride = std::max(1, cells / 4096);  // a sample of the cells is enough
  double worst = 0;
  const double ms = bench::elapsed_ms([&] {
    for (int cell = 0; cell < cells; cell += stride)
      worst = std::max(worst, std::abs(brute_force_distance(s, cell, 4) - sensors.readings(0)[cell]));
  });
  if (json) return print_json(w, "proximity, every object at every cell", ms * stride);
  std::printf("%-20s every object at every cell %10.1f ms, %.0f times longer; differs by at most %.1e\n", "",
              ms * stride, ms * stride / ours_ms, worst);
}

constexpr Workload kLadder[] = {{64, 100, false},   {64, 1000, false},   {128, 1000, false},
                                {128, 5000, false}, {256, 10000, false}, {1024, 10000, false},
                                {128, 5000, true},  {256, 10000, true}};

Options read_options(int argc, char** argv) {
  Options o;
  CLI::App app("Benchmarks each sensor model of a surface", "bench_sensors");
  app.add_option("--only", o.only, "one workload, such as \"256x256 10000\"")
      ->check(bench::one_of(kLadder, [](const Workload& w) { return w.name(); }));
  app.add_option("--model", o.model, "one model, such as proximity")
      ->check(bench::one_of(kModels, [](const Model& m) { return m.label; }));
  app.add_option("--repeats", o.repeats, "repetitions of each measurement")->check(CLI::Range(1, 1'000'000));
  app.add_option("--threads", o.threads)->check(CLI::Range(1, 1024));
  app.add_flag("!--no-peer", o.peer, "skip the comparison with brute force");
  app.add_flag("--json", o.json, "print one JSON object per line");
  bench::parse_or_exit(app, argc, argv);
  return o;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = read_options(argc, argv);
  common::ThreadPool pool(options.threads);
  for (const Workload& w : kLadder) {
    if (!options.only.empty() && w.name() != options.only) continue;
    Scene s = scene_of(w);
    for (const Model& model : kModels) {
      if (!options.model.empty() && model.label != options.model) continue;
      const double ms = run_model(s, model, options, pool);
      if (options.json)
        print_json(w, model.label, ms);
      else
        std::printf("%-20s %-18s %8.3f ms\n", w.name().c_str(), model.label.c_str(), ms);
      std::fflush(stdout);
      if (options.peer && !w.mixed && model.label == "proximity") compare(s, w, ms, options.json, pool);
    }
  }
}
