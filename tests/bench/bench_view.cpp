// Benchmarks the stages of a frame of the simulator's view, rendered off-screen.
//
//   bench_view [--cells 64] [--objects 500] [--size 1280x720] [--frames 60] [--pins sorting|wave]
//              [--quality fast|card|video|fine] [--mixed] [--picture FILE.png] [--window|--held] [--json]
//
// Prints wall-clock time and CPU time of all threads in milliseconds, and the number of draw calls.
// glFinish() ends each stage, so their sum slightly exceeds the time of a frame. The stage "values" runs on
// the CPU: heights, shades and poses.
//
// --window measures a real window instead, including panels, timeline and buffer swap, at its adaptive
// resolution during a run; --held: at that of a paused run. --json prints these as one JSON object.
#include <epoxy/gl.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/gl/EglContext.h"
#include "common/image/Image.h"
#include "common/image/Png.h"
#include "smartsurf/view/gl/GlObjects.h"
#include "smartsurf/view/gl/Renderer.h"
#include "smartsurf/view/window/Window.h"
#include "tests/bench/CommandLine.h"
#include "tests/bench/Timing.h"
#include "tests/unit/smartsurf/view/DrawCallCounter.h"

using namespace smartsurf;

namespace {

struct Options {
  int cells = 64, objects = 500, width = 1280, height = 720, frames = 60;
  std::string pins = "sorting", quality = "fast", png_file;
  bool mixed = false, window = false, paused = false, json = false;
};

using Clock = std::chrono::steady_clock;

struct BenchScene {
  scene::SceneSpec spec;
  scene::Snapshot snapshot;
  std::vector<Eigen::Vector3f> rest_positions;  // of each object
};

// Places the objects in rows over the whole table, in as many layers as needed.
void add_objects(BenchScene& s, const Options& options) {
  const int across = std::max(1, static_cast<int>((options.cells - 4) / 2.6));
  for (int k = 0; k < options.objects; ++k) {
    scene::ObjectSpec o;
    o.radius = k % 3 == 0 ? 1.2 : 0.9;
    o.colour = k % 3 == 0 ? scene::Colour{0.84f, 0.37f, 0.0f} : scene::Colour{0.0f, 0.45f, 0.7f};
    if (options.mixed) o.shape = static_cast<scene::ShapeKind>(k % 5);
    o.height = 2.0;
    o.size = {1.6, 1.6, 1.6};
    const float x = 2.5f + 2.6f * static_cast<float>(k % across);
    const float y = 2.5f + 2.6f * static_cast<float>(k / across % across);
    s.rest_positions.emplace_back(x, y, 4.0f + 2.4f * static_cast<float>(k / (across * across)));
    s.snapshot.id.push_back(static_cast<scene::ObjectId>(k));
    s.snapshot.position.emplace_back();
    s.snapshot.orientation.push_back({0, 0, 0, 1});
    s.spec.objects.push_back(o);
  }
  s.snapshot.velocity.resize(s.snapshot.object_count());
  s.snapshot.angular_velocity.resize(s.snapshot.object_count());
}

// sorting: all pins up except for a pocket under each object. wave: all pins at different heights.
void animate(BenchScene& s, const Options& options, int frame) {
  const float phase = 0.1f * static_cast<float>(frame);
  const auto& surface = s.spec.surface;
  for (int r = 0; r < surface.rows; ++r)
    for (int c = 0; c < surface.columns; ++c) {
      const float x = static_cast<float>(c), y = static_cast<float>(r);
      float& height = s.snapshot.height[surface.index(r, c)];
      height = surface.is_border(r, c) ? 6.0f : 4.0f;
      if (options.pins == "wave") height = 3.0f + 1.5f * std::sin(0.7f * x + phase) + std::cos(0.9f * y);
    }
  for (std::size_t i = 0; i < s.rest_positions.size(); ++i) {
    const float x = s.rest_positions[i].x() + 0.8f * std::sin(phase + 0.1f * static_cast<float>(i)),
                y = s.rest_positions[i].y();
    s.snapshot.position[i] = {x, y, s.rest_positions[i].z() + (options.pins == "wave" ? 2.8f : -1.5f)};
    if (options.pins == "wave") continue;
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx) {
        const int c = static_cast<int>(x + 0.5f) + dx, r = surface.rows - 1 - static_cast<int>(y + 0.5f) - dy;
        if (r > 0 && c > 0 && r < surface.rows - 1 && c < surface.columns - 1)
          s.snapshot.height[surface.index(r, c)] = 1.0f;
      }
  }
}

BenchScene make_scene(const Options& options) {
  BenchScene s;
  s.spec.surface.rows = s.spec.surface.columns = options.cells;
  s.spec.surface.border_height = 6.0;
  s.snapshot.height.resize(static_cast<std::size_t>(s.spec.surface.cell_count()));
  add_objects(s, options);
  return s;
}

// The times of a stage or a whole frame, indexed by frame.
struct StageTimes {
  std::string name;
  std::vector<double> wall_ms, cpu_ms;
  void print() const;
};

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

void StageTimes::print() const {
  std::printf("  %-22s %7.2f  %7.2f  %7.2f\n", name.c_str(), bench::median(wall_ms), mean(wall_ms),
              mean(cpu_ms));
}

void print_heading() { std::printf("  %-22s %7s  %7s  %7s\n", "ms", "median", "mean", "CPU, mean"); }

// CPU time of all threads of this process.
double process_cpu_ms() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

view::RenderQuality parse_quality(const std::string& name) {
  if (name == "fast") return view::RenderQuality::fast();
  if (name == "card") return view::RenderQuality::gpu();
  if (name == "video") return view::RenderQuality::video();
  if (name == "fine") return view::RenderQuality::fine();
  throw std::invalid_argument("--quality " + name + ": fast, card, video or fine");
}

// Measures the time between the ends of successive stages.
class StageTimer {
 public:
  void begin() {
    wall_start_ = Clock::now();
    cpu_start_ = process_cpu_ms();
  }
  void end_stage(std::string_view stage) {
    glFinish();
    const auto now = Clock::now();
    const double cpu_now = process_cpu_ms();
    auto entry =
        std::find_if(stages_.begin(), stages_.end(), [&](const StageTimes& t) { return t.name == stage; });
    if (entry == stages_.end()) entry = stages_.insert(entry, {std::string(stage), {}, {}});
    entry->wall_ms.push_back(std::chrono::duration<double, std::milli>(now - wall_start_).count());
    entry->cpu_ms.push_back(cpu_now - cpu_start_);
    wall_start_ = now;
    cpu_start_ = cpu_now;
  }
  // Wall-clock and CPU time in milliseconds.
  std::pair<double, double> elapsed_ms() const {
    return {std::chrono::duration<double, std::milli>(Clock::now() - wall_start_).count(),
            process_cpu_ms() - cpu_start_};
  }
  void print() const {
    for (const StageTimes& t : stages_) t.print();
  }

 private:
  Clock::time_point wall_start_{};
  double cpu_start_ = 0.0;
  std::vector<StageTimes> stages_;
};

void measure_renderer(const Options& options) {
  BenchScene s = make_scene(options);
  common::EglContext context;
  std::printf("%s\n%d x %d cells, %d objects, %d x %d pixels, %s, %s\n",
              reinterpret_cast<const char*>(glGetString(GL_RENDERER)), options.cells, options.cells,
              options.objects, options.width, options.height, options.pins.c_str(), options.quality.c_str());
  view::Renderer renderer(s.spec, parse_quality(options.quality));
  view::RenderTarget target;
  target.resize(options.width, options.height);
  const view::Camera camera = view::Camera::fit_to_surface(
      s.spec.surface, view::CameraPreset::kIso, static_cast<double>(options.width) / options.height);
  const auto draw = [&](int frame) {
    animate(s, options, frame);
    renderer.draw(s.snapshot, s.spec.objects, camera, {}, target.framebuffer.id(), options.width,
                  options.height);
  };
  for (int frame = -4; frame < 0; ++frame) draw(frame);
  glFinish();
  StageTimer stage_timer, frame_timer;
  renderer.set_stage_callback([&](std::string_view stage) { stage_timer.end_stage(stage); });
  for (int frame = 0; frame < options.frames; ++frame) {
    stage_timer.begin();
    draw(frame);
  }
  renderer.set_stage_callback(nullptr);
  const view::DrawCallCounter calls;
  for (int frame = 0; frame < options.frames; ++frame) {
    frame_timer.begin();
    draw(frame);
    frame_timer.end_stage("a frame");
  }
  print_heading();
  stage_timer.print();
  frame_timer.print();
  std::printf("  %.1f draw calls a frame\n", static_cast<double>(calls.count()) / options.frames);
  if (!options.png_file.empty())
    common::write_png(options.png_file,
                      view::read_framebuffer(target.framebuffer.id(), options.width, options.height));
}

void print_window_times(const Options& options, const StageTimes& times) {
  std::printf("%d x %d cells, %d objects, a window of %d x %d, %s, %s\n", options.cells, options.cells,
              options.objects, options.width, options.height, options.pins.c_str(),
              options.paused ? "held" : "running");
  print_heading();
  times.print();
}

void measure_window(const Options& options) {
  BenchScene s = make_scene(options);
  view::Window window(s.spec, "bench_view", options.width, options.height);
  view::Status status;
  status.paused = options.paused;
  status.timeline = view::Timeline{1000, 999, 0.0, 16.6, false, {}};
  StageTimes times{"a frame, shown", {}, {}};
  for (int frame = -40; frame < options.frames; ++frame) {  // warm-up: the window adapts its resolution
    animate(s, options, frame);
    StageTimer timer;
    timer.begin();
    static_cast<void>(window.render_frame({s.snapshot, s.spec.objects}, status));
    if (frame < 0) continue;
    const auto [clock_ms, busy_ms] = timer.elapsed_ms();
    times.wall_ms.push_back(clock_ms);
    times.cpu_ms.push_back(busy_ms);
  }
  if (options.json)
    std::printf(
        "{\"benchmark\": \"view\", \"case\": \"%dx%d %d\", \"state\": \"%s\", \"median_ms\": %.3f, "
        "\"cpu_ms\": %.3f}\n",
        options.cells, options.cells, options.objects, options.paused ? "held" : "running",
        bench::median(times.wall_ms), mean(times.cpu_ms));
  else
    print_window_times(options, times);
  if (!options.png_file.empty())
    common::write_png(options.png_file, window.capture_frame({s.snapshot, s.spec.objects}, status));
}

Options read_options(int argc, char** argv) {
  Options o;
  const auto size = [&o](const std::string& text) {
    char rest = 0;
    if (std::sscanf(text.c_str(), "%dx%d%c", &o.width, &o.height, &rest) != 2 || o.width < 1 || o.height < 1)
      throw CLI::ValidationError("--size " + text + ": must be like 1280x720");
  };
  CLI::App app("Benchmarks the stages of a frame of the simulator's view", "bench_view");
  app.add_option("--cells", o.cells, "cells per edge")->check(CLI::Range(1, 4096));
  app.add_option("--objects", o.objects)->check(CLI::Range(0, 1'000'000));
  app.add_option_function<std::string>("--size", size, "size of the picture, such as 1280x720");
  app.add_option("--frames", o.frames)->check(CLI::Range(1, 1'000'000));
  app.add_option("--pins", o.pins)->check(CLI::IsMember({"sorting", "wave"}));
  app.add_option("--quality", o.quality)->check(CLI::IsMember({"fast", "card", "video", "fine"}));
  app.add_option("--picture", o.png_file, "save the last frame to this PNG file");
  app.add_flag("--mixed", o.mixed, "objects of all shapes");
  app.add_flag("--json", o.json, "print the times of a window as a JSON object");
  app.add_flag("--window", o.window, "measure frames of a window");
  app.add_flag_function(
      "--held", [&o](std::int64_t) { o.window = o.paused = true; }, "the same, with a paused simulation");
  bench::parse_or_exit(app, argc, argv);
  return o;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = read_options(argc, argv);
  try {
    options.window ? measure_window(options) : measure_renderer(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_view: error: %s\n", error.what());
    return 1;
  }
}
