#include "apron/run/WindowRun.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>

#include "apron/debugger/Runner.h"
#include "apron/run/StopSignal.h"
#include "apron/ui/Window.h"

namespace apron::run {
namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr double kFrame_s = 1.0 / 60.0, kIdleFrame_s = 0.1;

// Whether a file of the program was saved since it was read.
class FileWatch {
 public:
  explicit FileWatch(const std::vector<debugger::SourceText>& texts) { watch(texts); }

  void watch(const std::vector<debugger::SourceText>& texts) {
    times_.clear();
    for (const debugger::SourceText& text : texts) times_[text.name] = time_of(text.name);
  }
  // Looks at the disk at most twice a second.
  bool changed() {
    if (Clock::now() < next_) return false;
    next_ = Clock::now() + std::chrono::milliseconds(500);
    bool changed = false;
    for (auto& [name, time] : times_) {
      const fs::file_time_type now = time_of(name);
      // An editor that replaces the file leaves a moment without one.
      if (now == fs::file_time_type::min() || now == time) continue;
      time = now;
      changed = true;
    }
    return changed;
  }

 private:
  static fs::file_time_type time_of(const std::string& name) {
    std::error_code error;
    const fs::file_time_type time = fs::last_write_time(name, error);
    return error ? fs::file_time_type::min() : time;
  }

  std::map<std::string, fs::file_time_type> times_;
  Clock::time_point next_ = Clock::now();
};

ui::Placement placement(const Geometry& geometry) {
  ui::Placement place;
  place.width = geometry.width;
  place.height = geometry.height;
  place.beside = geometry.beside;
  if (geometry.at) {
    place.placed = true;
    place.x = geometry.at->first;
    place.y = geometry.at->second;
  }
  return place;
}

class WindowLoop {
 public:
  explicit WindowLoop(Drawn& drawn)
      : drawn_(drawn),
        bench_(drawn.bench),
        files_(drawn.run.compiled.texts),
        window_(title(drawn.run.options), placement(drawn.run.options.geometry)),
        runner_(drawn.session, interrupt_flag()) {
    if (!drawn.run.options.hold) bench_.run();
  }

  void run() {
    while (!stop_flag()) {
      const Clock::time_point start = Clock::now();
      if (debugger::Look look; runner_.take(look)) {
        bench_.update(std::move(look));
        asked_ = false;
      }
      if (!window_.frame(bench_)) return;
      std::fflush(stdout);  // a program without a surface never waits
      if (bench_.take_reload() || files_.changed()) reload();
      for (ui::Workbench::Order& order : bench_.take_orders()) runner_.post(std::move(order));
      if (!asked_) runner_.ask(bench_.request());
      asked_ = true;
      runner_.tend();
      pause(start);
    }
  }

 private:
  static std::string title(const Options& options) {
    const std::string name = fs::path(options.program).filename().string();
    return "APRON  " + name + (options.surface.empty() ? "" : "  on " + options.surface);
  }

  // At most 60 frames a second; where drawing is slow, most of the time is left to the program and the
  // simulator.
  void pause(Clock::time_point start) {
    const double drawing = std::chrono::duration<double>(Clock::now() - start).count();
    const double frame = bench_.running() || !calm_ ? std::max(kFrame_s, 3.0 * drawing) : kIdleFrame_s;
    calm_ = !bench_.running();
    window_.wait(std::max(0.001, frame - drawing));
  }

  void reload() {
    const DrawnRun& run = drawn_.run;
    std::string wrong;
    std::optional<Compiled> compiled = compile_texts(run.options, run.width, run.height, wrong);
    if (!compiled) {
      bench_.notice = "Not reloaded: " + wrong.substr(0, wrong.find('\n'));
      drawn_.panel.note("not reloaded:\n" + wrong);
      return;
    }
    files_.watch(compiled->texts);
    bench_.notice.clear();
    for (ui::Workbench::Order& order : bench_.take_orders()) runner_.post(std::move(order));
    runner_.post([this, program = compiled->program](debugger::Session& session) {
      const std::string missing =
          drawn_.run.host.load_modules(program.modules, module_paths(drawn_.run.options));
      if (!missing.empty()) drawn_.panel.note(missing);  // and calling it fails
      drawn_.panel.clear_program();
      session.replace(program);
    });
    drawn_.panel.note("reloaded");
    bench_.show_program(std::move(compiled->program), compiled->texts, ++programs_);
    asked_ = false;
  }

  Drawn& drawn_;
  ui::Workbench& bench_;
  FileWatch files_;
  ui::Window window_;
  debugger::Runner runner_;
  std::uint64_t programs_ = 1;
  bool asked_ = false, calm_ = false;
};

}  // namespace

void run_in_window(Drawn& drawn) { WindowLoop(drawn).run(); }

}  // namespace apron::run
