#include "smartsurf/run/LiveRecording.h"

#include <fmt/format.h>
#include <shm_protocol/ObserverEndpoint.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "common/process/ExitStatus.h"
#include "common/process/StopSignals.h"
#include "common/text/Number.h"
#include "common/text/Printable.h"
#include "smartsurf/record/OpenRecorder.h"
#include "smartsurf/record/Recorder.h"
#include "smartsurf/record/hdf5/Names.h"

namespace smartsurf::run {
namespace {

using shm_protocol::ChannelSpec;
using shm_protocol::Description;
using shm_protocol::Direction;
using shm_protocol::ObserverEndpoint;
using shm_protocol::Status;
using std::chrono::steady_clock;

namespace live = record::paths::live;

constexpr std::uint64_t kUnknown = std::numeric_limits<std::uint64_t>::max();

// Tells the process that waits for this one, at the other end of the pipe SMARTSURF_READY, that it is
// attached.
void report_ready() {
  const char* const text = std::getenv("SMARTSURF_READY");
  int pipe = -1;
  if (text && common::parse_number(std::string(text), pipe) && pipe > STDERR_FILENO) {
    (void)!::write(pipe, "r", 1);
    ::close(pipe);
  }
  ::unsetenv("SMARTSURF_READY");
}

std::uint64_t host_ns() {
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(since).count());
}

// True if the cells lie where those of a regular grid do, at whatever height.
bool is_grid(const Description& d) {
  const auto is_at = [](float at, double place) { return at == static_cast<float>(place); };
  for (std::size_t i = 0; i < d.positions.size(); ++i) {
    const auto& [x, y, z] = d.positions[i];
    const std::size_t row = i / d.columns, column = i % d.columns;
    if (!is_at(x, static_cast<double>(column) * d.pitch) ||
        !is_at(y, static_cast<double>(d.rows - 1 - row) * d.pitch))
      return false;
  }
  return true;
}

// The scene that a live surface stands for: its cells and the range of its heights, and no objects.
scene::SceneSpec scene_of(const Description& d) {
  scene::SceneSpec spec;
  spec.surface.rows = static_cast<int>(d.rows);
  spec.surface.columns = static_cast<int>(d.columns);
  spec.surface.pitch = d.pitch;
  scene::PinSpec& pin = spec.surface.pin;
  pin.top_x = pin.top_y = d.pitch;
  if (const int height = d.channel(Direction::kActuator, "height"); height >= 0) {
    pin.min_height = d.channels[height].minimum;
    pin.max_height = d.channels[height].maximum;
  }
  std::vector<float>& base = spec.surface.base_heights;
  for (const auto& [x, y, z] : d.positions) {
    spec.surface.cell_poses.push_back({static_cast<double>(x), static_cast<double>(y), 0.0});
    base.push_back(z);
  }
  if (std::ranges::all_of(base, [](float z) { return z == 0.0F; })) base.clear();
  if (is_grid(d)) spec.surface.cell_poses.clear();
  derive_pin_spec(spec.surface);
  spec.world.control_period_s = static_cast<double>(d.period_ns) * 1e-9;
  spec.record.objects = false;
  spec.record.sensors = scene::SensorRecording::kAlways;
  spec.record.actuators = true;
  return spec;
}

record::RunMetadata metadata_of(const Description& d, const LiveRecordingOptions& options) {
  record::RunMetadata meta;
  meta.command_line = options.command_line;
  meta.mode = d.mode == shm_protocol::Mode::kPassive ? "passive" : "time-step";
  meta.driver = "controller";
  meta.declares_success = false;
  meta.is_simulated = false;
  for (const ChannelSpec& c : d.channels)
    meta.live_channels.push_back({c.name, c.direction == Direction::kSensor, c.unit, c.minimum, c.maximum});
  return meta;
}

// The channels of one direction as plain numbers.
class Planes {
 public:
  Planes(const Description& d, Direction direction) : description_(d), direction_(direction) {
    for (int i = 0; i < std::ssize(d.channels); ++i) {
      const ChannelSpec& c = d.channels[i];
      if (c.direction != direction) continue;
      channels_.push_back(i);
      values_.emplace_back(d.cells() * c.components, static_cast<float>(c.safe));
    }
    for (std::size_t i = 0; i < channels_.size(); ++i) {
      const ChannelSpec& c = d.channels[channels_[i]];
      data_.push_back({c.name, static_cast<int>(d.rows), static_cast<int>(d.columns),
                       static_cast<int>(c.components), values_[i]});
    }
  }
  void copy(const ObserverEndpoint& observer) {
    for (std::size_t i = 0; i < channels_.size(); ++i)
      shm_protocol::with_element_type(description_.channels[channels_[i]].dtype, [&]<class T>(T) {
        std::ranges::transform(observer.array<T>(channels_[i]), values_[i].begin(),
                               [](T value) { return static_cast<float>(value); });
      });
  }
  const std::vector<scene::ChannelData>& data() const { return data_; }
  std::span<const float> find(std::string_view name) const {
    const auto at = std::ranges::find(data_, name, &scene::ChannelData::name);
    return at == data_.end() ? std::span<const float>() : at->values;
  }

 private:
  const Description& description_;
  Direction direction_;
  std::vector<int> channels_;
  std::vector<std::vector<float>> values_;
  std::vector<scene::ChannelData> data_;
};

// The boards of a bridge, which it publishes as a surface of its own with one row: all of its channels.
class Boards {
 public:
  explicit Boards(const std::string& surface) {
    try {
      observer_.emplace(
          ObserverEndpoint::attach(surface + ".boards", {.timeout = std::chrono::milliseconds(0)}));
    } catch (const shm_protocol::Error&) {
      return;  // the surface is not a table of boards
    }
    const Description& d = observer_->description();
    for (int i = 0; i < std::ssize(d.channels); ++i) {
      const ChannelSpec& c = d.channels[i];
      const bool real = c.dtype == shm_protocol::DType::kF32;
      if (c.direction != Direction::kSensor || c.components != 1 ||
          (!real && c.dtype != shm_protocol::DType::kU32))
        continue;
      channels_.push_back({i, c.name, {}, {}});
      if (real)
        channels_.back().reals.resize(d.cells());
      else
        channels_.back().words.resize(d.cells());
    }
  }
  // Reads the state at that tick. Without it, all is unknown.
  void read(std::uint64_t tick) {
    if (!observer_) return;
    while (observer_->info(Direction::kSensor).frame == 0 || observer_->info(Direction::kSensor).tick < tick)
      if (observer_->next(Direction::kSensor) != Status::kOk) break;
    const bool known =
        observer_->info(Direction::kSensor).frame != 0 && observer_->info(Direction::kSensor).tick == tick;
    for (Channel& c : channels_) {
      if (!known) {
        std::ranges::fill(c.words, kUnknown);
        std::ranges::fill(c.reals, std::numeric_limits<float>::quiet_NaN());
      } else if (c.reals.empty()) {
        std::ranges::copy(observer_->array<std::uint32_t>(c.index), c.words.begin());
      } else {
        std::ranges::copy(observer_->array<float>(c.index), c.reals.begin());
      }
    }
  }
  void append(std::vector<record::LiveRow>& rows) const {
    for (const Channel& c : channels_) rows.push_back({live::kBoards, c.name, c.words, c.reals});
  }

 private:
  struct Channel {
    int index;
    std::string name;
    std::vector<std::uint64_t> words;  // one of both is empty
    std::vector<float> reals;
  };
  std::optional<ObserverEndpoint> observer_;
  std::vector<Channel> channels_;
};

class LiveRecording {
 public:
  explicit LiveRecording(const LiveRecordingOptions& options, ObserverEndpoint observer)
      : options_(options),
        observer_(std::move(observer)),
        published_before_(observer_.published(Direction::kSensor)),
        spec_(scene_of(observer_.description())),
        sensors_(observer_.description(), Direction::kSensor),
        actuators_(observer_.description(), Direction::kActuator),
        boards_(options.surface),
        recorder_(record::open_recorder(options.file, metadata_of(observer_.description(), options), spec_)) {
    snapshot_.height.assign(spec_.surface.cell_count(), 0.0F);
    const auto period = std::chrono::nanoseconds(observer_.description().period_ns);
    poll_ = std::clamp<std::chrono::nanoseconds>(period / 20, std::chrono::microseconds(100),
                                                 std::chrono::milliseconds(1));
  }

  int run() {
    Status end = Status::kOk;
    auto last = steady_clock::now();
    bool flushed = true;
    while (!common::stop_flag() && !(options_.frames && frames_ >= *options_.frames)) {
      const auto [sensed, when] = look_for(Direction::kSensor);
      if (sensed == Status::kOk) {
        finish_frame();
        if (options_.frames && frames_ >= *options_.frames) break;
        begin_frame(when);
        last = steady_clock::now();
        flushed = false;
      }
      follow_answers();
      if (sensed == Status::kOk) continue;
      if (sensed != Status::kRepeated && sensed != Status::kTorn) {
        end = sensed;
        break;
      }
      if (!flushed && steady_clock::now() - last > record::kMaxFlushInterval) {
        finish_frame();
        recorder_->flush();
        flushed = true;
      }
      std::this_thread::sleep_for(poll_);
    }
    finish_frame();
    return close(end);
  }

 private:
  // Bounds of when a frame came: the start of the last look that found none, and the end of the one that
  // found it. The interval is long if the recorder wrote or the computer was busy, or if no look came between
  // this frame and another one: both may have waited.
  struct Arrival {
    steady_clock::time_point earliest, latest;
  };
  struct Found {
    Status status;
    Arrival when;
  };
  Found look_for(Direction direction) {
    const auto start = steady_clock::now();
    const Status status = observer_.next(direction);
    steady_clock::time_point& looked_at =
        direction == Direction::kSensor ? sensors_looked_at_ : answers_looked_at_;
    const auto earliest = looked_at;
    if (status == Status::kOk)
      looked_at = {};
    else if (status != Status::kTorn)
      looked_at = start;
    return {status, {earliest, steady_clock::now()}};
  }
  bool is_known(const Arrival& a) const { return a.latest - a.earliest <= 2 * poll_; }

  void begin_frame(const Arrival& when) {
    const shm_protocol::FrameInfo& info = observer_.info(Direction::kSensor);
    // Numbers of frames only grow: a surface that restarts is another session, which ends this observer.
    // All since the recorder attached, whose number has 32 bits, are expected.
    const auto since = static_cast<std::uint32_t>(info.frame) - published_before_;
    lost_ = last_frame_ != 0 ? info.frame - last_frame_ - 1 : since == 0 ? 0 : since - 1;
    last_frame_ = info.frame;
    lost_frames_ += lost_;
    sensors_.copy(observer_);
    snapshot_.tick = info.tick;
    snapshot_.time_s = info.time_s;
    status_ = info.status;
    seen_ns_ = host_ns();
    arrival_ = when;
    latency_us_ = std::numeric_limits<float>::quiet_NaN();
    open_ = true;
  }

  // The newest commands, and how long the answer to the open frame took. That frame is then written, before
  // the next one comes.
  void follow_answers() {
    for (Found found = look_for(Direction::kActuator); found.status == Status::kOk;
         found = look_for(Direction::kActuator)) {
      const shm_protocol::FrameInfo& info = observer_.info(Direction::kActuator);
      actuators_.copy(observer_);
      answered_tick_ = info.tick;
      if (!open_ || info.answers != last_frame_) continue;
      const Arrival answer{std::max(found.when.earliest, arrival_.earliest), found.when.latest};
      if (is_known(arrival_) && is_known(answer))
        latency_us_ = std::chrono::duration<float, std::micro>(answer.latest - arrival_.latest).count();
      finish_frame();
    }
  }

  void finish_frame() {
    if (!open_) return;
    open_ = false;
    set_heights();
    boards_.read(snapshot_.tick);
    const std::uint64_t status = status_;
    std::vector<record::LiveRow> rows{{record::paths::kClock, live::kHostTime, {&seen_ns_, 1}, {}},
                                      {live::kAnswers, live::kAnsweredTick, {&answered_tick_, 1}, {}},
                                      {live::kAnswers, live::kLatency, {}, {&latency_us_, 1}},
                                      {live::kRoot, live::kStatus, {&status, 1}, {}},
                                      {live::kRoot, live::kLost, {&lost_, 1}, {}}};
    boards_.append(rows);
    recorder_->record_live(rows);
    recorder_->record_frame(snapshot_, {}, sensors_.data(), actuators_.data());
    ++frames_;
  }

  // Sensed heights if the surface senses them, or else the commanded ones, which count from the base.
  void set_heights() {
    std::vector<float>& to = snapshot_.height;
    const std::span<const float> sensed = sensors_.find("pin_height"), commanded = actuators_.find("height");
    if (!sensed.empty()) {
      if (sensed.size() == to.size()) std::ranges::copy(sensed, to.begin());
    } else if (commanded.size() == to.size()) {
      for (std::size_t i = 0; i < to.size(); ++i) to[i] = commanded[i] + spec_.surface.base_height(i);
    }
  }

  int close(Status end) {
    const std::string outcome = end == Status::kSurfaceDead     ? "the surface died"
                                : end == Status::kSurfaceClosed ? "the surface closed"
                                : common::stop_flag()           ? "stopped by the user"
                                                                : "done";
    recorder_->close({.outcome = outcome, .ticks = snapshot_.tick, .simulated_s = snapshot_.time_s});
    common::print_output(fmt::format("frames {} lost {}: {}\n", frames_, lost_frames_, outcome));
    if (end == Status::kSurfaceDead) {
      common::print_error_line("smartsurf", "surface '" + options_.surface +
                                                "' died; what was recorded is in " + options_.file.string());
      return common::kPeerLost;
    }
    return common::status_after_signals(common::kDone);
  }

  const LiveRecordingOptions& options_;
  ObserverEndpoint observer_;
  std::uint32_t published_before_;  // the last frame before the recorder attached
  scene::SceneSpec spec_;
  Planes sensors_, actuators_;
  Boards boards_;
  std::unique_ptr<record::Recorder> recorder_;
  scene::Snapshot snapshot_;
  std::chrono::nanoseconds poll_{0};
  bool open_ = false;  // a sensor frame waits for its answer, or for the next frame
  std::uint64_t last_frame_ = 0, lost_ = 0, lost_frames_ = 0, frames_ = 0;
  std::uint64_t status_ = 0, seen_ns_ = 0, answered_tick_ = kUnknown;
  Arrival arrival_{};  // the open frame
  steady_clock::time_point sensors_looked_at_, answers_looked_at_;
  float latency_us_ = 0;
};

}  // namespace

int record_live_surface(const LiveRecordingOptions& options) {
  common::catch_stop_signals();
  std::optional<ObserverEndpoint> observer;
  try {
    observer.emplace(
        ObserverEndpoint::attach(options.surface, {.timeout = options.wait, .stop = &common::stop_flag()}));
  } catch (const shm_protocol::Error& e) {
    switch (e.code()) {
      case shm_protocol::ErrorCode::kInterrupted:
        return common::status_after_signals(common::kDone);
      case shm_protocol::ErrorCode::kNotFound:
        common::print_error_line("smartsurf", std::string("record: ") + e.what());
        return common::kPeerLost;
      default:
        throw scene::InputError(std::string("record: ") + e.what());
    }
  }
  LiveRecording recording(options, std::move(*observer));
  report_ready();
  return recording.run();
}

}  // namespace smartsurf::run
