#include "apron/run/ui/UiRunContext.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <utility>

#include "apron/debugger/SessionThread.h"
#include "apron/run/ui/LayoutFile.h"
#include "apron/ui/window/Window.h"
#include "common/files/AtomicFile.h"
#include "common/files/ReadFile.h"
#include "common/process/StopSignals.h"
#include "shm-protocol/hardware/bridge/ControlSocket.h"

namespace apron::run {
namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr double kFrame_s = 1.0 / 60.0, kIdleFrame_s = 0.1;

// Detects changes of the program's source files.
class SourceFileMonitor {
 public:
  explicit SourceFileMonitor(const std::vector<debugger::SourceText>& sources) { reset(sources); }

  void reset(const std::vector<debugger::SourceText>& sources) {
    times_.clear();
    for (const debugger::SourceText& source : sources) times_[source.name] = modification_time(source.name);
  }
  // Takes the files as they are now.
  void update() {
    for (auto& [name, time] : times_) time = modification_time(name);
  }
  // True if a file has changed since the last call or reset(). Checks the disk at most twice per second.
  bool poll_changed() {
    if (Clock::now() < next_poll_) return false;
    next_poll_ = Clock::now() + std::chrono::milliseconds(500);
    bool changed = false;
    for (auto& [name, time] : times_) {
      const fs::file_time_type now = modification_time(name);
      // The file may be missing for a moment while an editor replaces it.
      if (now == fs::file_time_type::min() || now == time) continue;
      time = now;
      changed = true;
    }
    return changed;
  }

 private:
  static fs::file_time_type modification_time(const std::string& name) {
    std::error_code error;
    const fs::file_time_type time = fs::last_write_time(name, error);
    return error ? fs::file_time_type::min() : time;
  }

  std::map<std::string, fs::file_time_type> times_;
  Clock::time_point next_poll_ = Clock::now();
};

ui::WindowPlacement window_placement(const WindowGeometry& geometry) {
  ui::WindowPlacement placement;
  placement.width = geometry.width;
  placement.height = geometry.height;
  placement.beside_simulator = geometry.beside_simulator;
  if (geometry.position) {
    placement.has_position = true;
    placement.x = geometry.position->first;
    placement.y = geometry.position->second;
  }
  return placement;
}

class WindowLoop {
 public:
  explicit WindowLoop(UiRunContext& context)
      : context_(context),
        model_(context.model),
        file_monitor_(context.run.compiled.sources),
        window_(title(context.run.options), window_placement(context.run.options.geometry)),
        session_thread_(context.session, common::interrupt_flag()) {
    model_.layout = saved_layout_ = load_layout(context.run.options.reset_layout);
    if (!context.run.options.hold) model_.run();
  }
  ~WindowLoop() {
    if (model_.layout != saved_layout_) save_layout(model_.layout);
  }
  WindowLoop(const WindowLoop&) = delete;
  WindowLoop& operator=(const WindowLoop&) = delete;

  void run() {
    while (!common::stop_flag()) {
      const Clock::time_point start = Clock::now();
      if (debugger::DebugSnapshot snapshot; session_thread_.poll_snapshot(snapshot)) {
        model_.update(std::move(snapshot));
        snapshot_requested_ = false;
        if (model_.finished() && !was_finished_ && context_.run.on_finish)
          session_thread_.post([this](debugger::DebugSession&) { context_.run.on_finish(); });
        was_finished_ = model_.finished();
      }
      if (context_.run.host.surface_overdue() && !overdue_noticed_) {
        model_.notice = "The surface has waited 2 s for surface.step.";
        overdue_noticed_ = true;
      }
      if (!window_.render_frame(model_)) return;
      std::fflush(stdout);  // a program without frames never flushes its output
      if (std::exchange(model_.emergency_stop_requested, false)) stop_boards();
      if (const auto request = model_.editor.take_save_request()) save_source(*request);
      if (model_.take_reload_request() || file_monitor_.poll_changed()) reload();
      for (ui::ViewModel::SessionCommand& command : model_.take_commands())
        session_thread_.post(std::move(command));
      if (!snapshot_requested_) session_thread_.request_snapshot(model_.snapshot_request());
      snapshot_requested_ = true;
      session_thread_.interrupt_if_overdue();
      pace_frame(start);
    }
  }

 private:
  static std::string title(const Options& options) {
    const std::string name = fs::path(options.program).filename().string();
    return "APRON  " + name + (options.surface.empty() ? "" : "  on " + options.surface);
  }

  // Limits the frame rate to 60 Hz and drawing to a third of the time, which leaves the CPU to the program
  // and the simulator. Redraws at a lower rate while paused.
  void pace_frame(Clock::time_point start) {
    const double draw_time_s = std::chrono::duration<double>(Clock::now() - start).count();
    const double frame_time_s =
        model_.running() || !was_idle_ ? std::max(kFrame_s, 3.0 * draw_time_s) : kIdleFrame_s;
    was_idle_ = !model_.running();
    window_.wait_events(std::max(0.001, frame_time_s - draw_time_s));
  }

  void stop_boards() {
    const std::string& surface = context_.run.options.surface;
    if (surface.empty()) return;
    try {
      hardware::ask_bridge(surface, "stop");
      model_.notice = "Emergency stop. 'surface_bridge arm " + surface + "' releases it.";
    } catch (const std::runtime_error& e) {
      model_.notice = std::string("No emergency stop: ") + e.what();
    }
    context_.panel.note(model_.notice);
  }

  // Writes an edited file and reloads the program.
  void save_source(const ui::ProgramEditor::SaveRequest& request) {
    std::string text_on_disk;
    const bool readable = !common::read_file(request.name, common::kMaxTextBytes, text_on_disk);
    if (readable && text_on_disk != request.old_text) {
      model_.notice = request.name + " has changed on the disk. Save again to replace it, or revert.";
      model_.editor.mark_conflict(request, std::move(text_on_disk));
      return;
    }
    std::error_code ignored;
    const fs::perms mode = fs::status(request.name, ignored).permissions();
    if (const std::error_code error = common::replace_file(request.name, request.text)) {
      model_.notice = request.name + ": cannot be written: " + error.message();
      return;
    }
    if (readable) fs::permissions(request.name, mode, ignored);
    model_.editor.mark_saved(request);
    file_monitor_.update();
    reload();
  }

  void reload() {
    const UiRun& run = context_.run;
    CompilerMessages messages;
    std::optional<CompiledProgram> compiled =
        compile_with_sources(run.options, run.width, run.height, messages);
    model_.editor.diagnostics = std::move(messages.entries);
    if (!compiled) {
      model_.notice = "Not reloaded: " + messages.text.substr(0, messages.text.find('\n'));
      context_.panel.note("not reloaded:\n" + messages.text);
      for (const ui::ProgramEditor::File& file : model_.editor.files())
        if (std::string text; !common::read_file(file.name, common::kMaxTextBytes, text))
          model_.editor.set_text_on_disk(file.name, text);
      return;
    }
    file_monitor_.reset(compiled->sources);
    model_.notice.clear();
    for (ui::ViewModel::SessionCommand& command : model_.take_commands())
      session_thread_.post(std::move(command));
    session_thread_.post([this, program = compiled->program](debugger::DebugSession& session) {
      const std::string missing = context_.run.host.load_modules(program, context_.run.options.modules,
                                                                 module_search_paths(context_.run.options));
      if (!missing.empty()) context_.panel.note(missing);  // calling the module will fail
      context_.panel.clear_program();
      session.replace(program);
    });
    context_.panel.note("reloaded");
    model_.show_program(std::move(compiled->program), compiled->sources, ++program_id_);
    snapshot_requested_ = false;
  }

  UiRunContext& context_;
  ui::ViewModel& model_;
  ui::PaneLayout saved_layout_;
  SourceFileMonitor file_monitor_;
  ui::Window window_;
  debugger::SessionThread session_thread_;
  std::uint64_t program_id_ = 1;
  bool snapshot_requested_ = false, was_idle_ = false, was_finished_ = false, overdue_noticed_ = false;
};

}  // namespace

void run_in_window(UiRunContext& context) { WindowLoop(context).run(); }

}  // namespace apron::run
