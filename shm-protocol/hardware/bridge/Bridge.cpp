#include "shm-protocol/hardware/bridge/Bridge.h"

#include <poll.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

namespace hardware {

using shm_protocol::Direction;
using shm_protocol::DType;
using shm_protocol::Mode;
using shm_protocol::State;
using shm_protocol::Status;
using std::chrono::milliseconds;

namespace {

constexpr milliseconds kHandshakeInterval{200};  // between handshake attempts with a silent device
constexpr milliseconds kIdlePoll{20};            // polling interval of the stop flag
constexpr milliseconds kAnswerPoll{1};           // wait for the controller before the line is polled again

std::string seconds(std::chrono::microseconds t) {
  const std::string text = std::to_string(static_cast<double>(t.count()) * 1e-6);
  return text.substr(0, text.find('.') + 2) + " s";
}

}  // namespace

std::chrono::microseconds silence_of(const BridgeOptions& options, std::uint32_t period_us) {
  return std::max<std::chrono::microseconds>(options.silence_timeout,
                                             std::chrono::microseconds(4 * std::uint64_t{period_us}));
}

std::string limits_text(const DeviceChannel& c) {
  const ssw_limits& l = c.limits;
  if (!(l.slew > 0 || l.acceleration > 0 || l.soft_start > 0 || l.most_moving > 0)) return {};
  char line[256];
  std::snprintf(line, sizeof line,
                "  limits of %s: range %g … %g slew %g acceleration %g soft_start %g most_moving %u\n",
                c.name.c_str(), static_cast<double>(c.minimum), static_cast<double>(c.maximum),
                static_cast<double>(l.slew), static_cast<double>(l.acceleration),
                static_cast<double>(l.soft_start), static_cast<unsigned>(l.most_moving));
  return line;
}

std::shared_ptr<shm_protocol::SurfaceName> reserve_surface(const std::string& name,
                                                           const std::string& where) {
  try {
    return std::make_shared<shm_protocol::SurfaceName>(name);
  } catch (const shm_protocol::Error& e) {
    if (e.code() == shm_protocol::ErrorCode::kSystem) throw;
    throw std::invalid_argument(where + e.what());
  }
}

shm_protocol::SurfaceEndpoint create_described_surface(const shm_protocol::SurfaceConfig& config,
                                                       const std::string& who) {
  try {
    return shm_protocol::SurfaceEndpoint::create(config);
  } catch (const shm_protocol::Error& e) {
    if (e.code() != shm_protocol::ErrorCode::kBadConfig) throw;
    throw std::runtime_error(who + " cannot be a surface: " + e.what());
  }
}

Bridge::Bridge(BridgeOptions options, const std::atomic<bool>& stop, EventLog::Print log)
    : options_(std::move(options)),
      stop_(stop),
      log_(std::move(log)),
      name_(reserve_surface(options_.surface, "--shm: ")) {}

Outcome Bridge::run() {
  control_.emplace(options_.surface);
  std::optional<Outcome> end = connect();
  if (!end) {
    create_surface();
    await_recorder();
    has_begun_ = true;
    last_handshake_ = {};
    send_handshake();
    last_frame_ = Clock::now();
    while (!end) end = serve_once();
    send_stop();
  }
  count_line();
  surface_.reset();
  return *end;
}

// ---- connection

// One attempt at a time, in a thread: a TCP connection may take a second. Waits a moment. Returns whether the
// line is open.
bool Bridge::open_line(std::string& why) {
  constexpr auto kAttempt = kHandshakeInterval / 4;
  try {
    if (!opening_.valid())
      opening_ = std::async(std::launch::async, [address = options_.port] {
        std::string reason;
        auto port = Port::open(address, reason);
        return std::pair{std::move(port), std::move(reason)};
      });
    if (opening_.wait_for(kAttempt) != std::future_status::ready) return false;
    auto [port, reason] = opening_.get();
    if (port) {
      options_.port.local_port = port->local_port();
      line_.open(std::move(*port));
      return true;
    }
    why = reason;
  } catch (const std::system_error& error) {  // no thread
    why = error.what();
  }
  std::this_thread::sleep_for(kAttempt);
  return false;
}

// Opens the line and waits until the device has described itself. Returns nothing then; otherwise, after the
// timeout, logs lost(why) and returns how the run ends.
template <class Lost>
std::optional<Outcome> Bridge::await_device(std::optional<milliseconds> timeout, Lost lost) {
  const auto start = Clock::now();
  std::string why = options_.port.text + " does not answer";
  while (!line_.link().described()) {
    if (stop_.load()) return Outcome::kStopped;
    log_.print_due();
    serve_control();
    if (timeout && Clock::now() - start > *timeout) {
      log_.add("error: " + lost(why));
      return Outcome::kDeviceLost;
    }
    if (!line_.is_open() && !open_line(why)) continue;
    send_handshake();
    poll_line(kIdlePoll);
    why = options_.port.text + " is open, but " + line_.why_undescribed();
    if (const auto end = end_of_fault()) return end;
  }
  return std::nullopt;
}

std::optional<Outcome> Bridge::connect() {
  return await_device(options_.connect_timeout,
                      [](const std::string& why) { return "the device does not come: " + why; });
}

// The line was lost. The session is suspended until the same device is back.
std::optional<Outcome> Bridge::reconnect() {
  const auto gone = [](const std::string&) { return std::string("the device is gone"); };
  if (const auto end = await_device(options_.reconnect_timeout, gone)) return end;
  ++counters_.reconnections;
  log_.add("the device is back");
  last_handshake_ = {};
  send_handshake();
  return std::nullopt;
}

std::optional<Outcome> Bridge::end_of_fault() {
  if (fault_.empty()) return std::nullopt;
  log_.add("error: " + fault_);
  return Outcome::kFailed;
}

void Bridge::on_line_lost(const std::string& reason) {
  line_.close();
  handshakes_ = 0;
  sequence_.restart();
  frame_ready_ = false;
  if (!surface_) return;
  enter_silence();
  log_.add(reason + "; the session waits for the device");
}

// Answers to frames from before a silence are stale.
void Bridge::enter_silence() {
  silent_ = true;
  status_ |= kAfterSilence;
  if (counters_.frames != 0) stale_tick_ = tick_;
  surface_->set_state(State::kPaused);
}

bool Bridge::may_send(std::uint64_t answered_tick) const {
  return !silent_ && line_.link().described() && (!stale_tick_ || answered_tick > *stale_tick_);
}

void Bridge::create_surface() {
  shm_protocol::SurfaceConfig config;
  config.name = options_.surface;
  config.reserved = name_;
  config.rows = device_->rows;
  config.columns = device_->columns;
  config.pitch = static_cast<double>(device_->pitch);
  config.period_ns = std::uint64_t{device_->period_us} * 1000;
  config.mode = options_.mode;
  config.hold_last_frame = options_.hold_last_frame;
  for (const DeviceChannel& c : device_->channels)
    config.channels.push_back({c.name, c.sensor ? Direction::kSensor : Direction::kActuator,
                               c.is_plain_u8() ? DType::kU8 : DType::kF32, c.components, c.unit,
                               static_cast<double>(c.minimum), static_cast<double>(c.maximum),
                               static_cast<double>(c.safe)});
  surface_.emplace(create_described_surface(config, "the device '" + device_->name + "'"));
  actuators_.assign(line_.link().actuator_elements(), 0.0F);
  log_.add("device '" + device_->name + "', " + std::to_string(device_->rows) + " rows of " +
           std::to_string(device_->columns) + " cells, every " + std::to_string(device_->period_us) +
           " us; controllers attach to '" + options_.surface + "'");
}

void Bridge::await_recorder() {
  if (!options_.is_recorder_ready) return;
  const auto until = Clock::now() + kRecorderPatience;
  while (!options_.is_recorder_ready()) {
    if (stop_.load() || !line_.is_open()) return;
    if (Clock::now() >= until) return log_.add("the recorder is late; the first frames are not recorded");
    serve_control();
    poll_line(kIdlePoll);
  }
}

// ---- line

bool Bridge::flush() {
  const bool connected = line_.flush();
  count_line();
  return connected;
}

void Bridge::count_line() {
  counters_.answers = line_.answers();
  counters_.unsent = line_.unsent();
  counters_.damaged_packets = line_.link().damaged_packets();
  counters_.lost_packets = line_.link().lost_packets();
}

// Waits up to `timeout` for bytes from the device and processes them; sends pending output. Returns false if
// the line is lost.
bool Bridge::poll_line(milliseconds timeout) {
  if (!line_.is_open()) return false;
  bool connected = flush();
  pollfd line{line_.descriptor(), static_cast<short>(POLLIN | (line_.pending_bytes() == 0 ? 0 : POLLOUT)), 0};
  if (connected && (line_.has_unread() || ::poll(&line, 1, static_cast<int>(timeout.count())) > 0)) {
    // All that is there (a terminal gives it in pieces): the controller gets the newest frame, and large ones
    // do not pile up while it computes. In passive mode it gets each.
    connected = line_.receive([this] { return options_.mode == Mode::kTimeStep || !frame_ready_; },
                              [this](DeviceLink::Event event) { on_event(event); });
    connected = connected && flush();
  }
  if (!connected) on_line_lost("the line to the device is cut");
  return connected;
}

void Bridge::on_event(DeviceLink::Event event) {
  switch (event) {
    case DeviceLink::Event::kNothing:
    case DeviceLink::Event::kAlive:
    case DeviceLink::Event::kClock:
    case DeviceLink::Event::kStatus:
      return;
    case DeviceLink::Event::kDescribed:
      return on_description();
    case DeviceLink::Event::kRejected:
      fault_ = line_.link().message();
      return;
    case DeviceLink::Event::kFault:
      return log_.add_report("the device reports: " + line_.link().message());
    case DeviceLink::Event::kFrame:
      return on_frame();
  }
}

void Bridge::on_description() {
  if (!device_) {
    device_ = line_.link().description();
    boot_id_ = device_->boot;
  } else if (!line_.link().description().is_compatible_with(*device_)) {
    fault_ = "another device came back: it has other cells or channels; restart the bridge";
  } else if (line_.link().description().boot != boot_id_) {
    boot_id_ = line_.link().description().boot;
    sequence_.restart();
    if (surface_) log_.add("the device was restarted");
  }
}

void Bridge::send_handshake() {
  const auto now = Clock::now();
  if (now - last_handshake_ < kHandshakeInterval || line_.pending_bytes() > 4096) return;
  last_handshake_ = now;
  // Version 2 is asked for twice, then both in turn; a device that has described itself stays with its
  // version.
  const bool second = device_ ? device_->version == 2 : handshakes_ < 2 || handshakes_ % 2 == 0;
  ++handshakes_;
  line_.write(second ? SSW_DESCRIBE2 : SSW_DESCRIBE, sequence_.tick());
  if (!surface_ || !line_.link().described()) return;
  line_.write(SSW_START, sequence_.tick());
  if (silent_) line_.write_safe_frame(sequence_.tick());
}

void Bridge::send_stop() {
  if (!line_.is_open()) return;
  line_.discard_pending();
  line_.write(SSW_STOP, sequence_.tick());
  for (int attempt = 0; attempt < 50 && line_.pending_bytes() != 0 && flush(); ++attempt)
    if (line_.pending_bytes() != 0) std::this_thread::sleep_for(kAnswerPoll);
}

// ---- session

std::optional<Outcome> Bridge::serve_once() {
  if (stop_.load()) return Outcome::kStopped;
  if (options_.ticks && counters_.frames >= *options_.ticks && !awaiting_answer_) return Outcome::kDone;
  if (!line_.is_open()) {
    if (const auto end = reconnect()) return end;
    last_frame_ = Clock::now();
  }
  const bool passive = options_.mode == Mode::kPassive;
  poll_line(awaiting_answer_ || frame_ready_ ? milliseconds(0) : passive ? kAnswerPoll : kIdlePoll);
  if (const auto end = end_of_fault()) return end;
  log_.print_due();
  serve_control();
  check_emergency_stop();
  if (frame_ready_ && !awaiting_answer_) publish();
  if (awaiting_answer_) poll_answer();
  if (passive) poll_latest();
  if (own_frame_due_) send_own_frame();
  check_silence();
  return std::nullopt;
}

// The device counts missed deadlines, because only it knows when its periods end.
void Bridge::count_missed_deadlines(std::uint32_t missed) {
  for (std::uint32_t i = 0; i < missed; ++i) surface_->miss_deadline();
  counters_.missed_deadlines += missed;
  if (missed != 0) status_ |= kMissedDeadline;
}

void Bridge::on_frame() {
  if (!has_begun_) return;
  const SensorFrame& frame = line_.link().frame();
  const auto now = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch());
  const bool is_first = !sequence_.known() && counters_.frames == 0;
  const auto step = sequence_.next(frame, now.count(), silence_of(options_, device_->period_us).count());
  if (!step) return;
  last_frame_ = Clock::now();
  if (step->restarted) enter_silence();
  count_missed_deadlines(step->missed);
  if (step->ticks > 1) {
    counters_.lost += step->ticks - 1;
    status_ |= kFramesLost;
  }
  flags_ = frame.flags;
  if (frame.flags & SSW_SAFE) status_ |= kSafeValuesActive;
  if (frame.flags & SSW_LIMITED) status_ |= kLimited;
  if (frame.flags & SSW_SOFT_START) status_ |= kSoftStart;
  if (!is_first) tick_ += step->ticks;
  if (silent_) log_.add("the device speaks again");
  silent_ = false;
  if (frame_ready_) {
    ++counters_.skipped;
    status_ |= kFramesLost;
  }
  // The host is alive and only the controller is slow: keep the device from applying its safe values.
  if (frame_ready_ || awaiting_answer_) line_.write(SSW_HEARTBEAT, sequence_.tick());
  frame_ready_ = true;
  if (needs_safe_frames()) own_frame_due_ = true;
}

void Bridge::publish() {
  frame_ready_ = false;
  const SensorFrame& frame = line_.link().frame();
  const auto& channels = device_->channels;
  for (int i = 0; i < std::ssize(channels); ++i) {
    const DeviceChannel& c = channels[i];
    if (!c.sensor) continue;
    const std::span<const float> from(frame.values.data() + c.first_element, c.elements);
    if (c.is_plain_u8())
      std::ranges::transform(from, surface_->sensor<std::uint8_t>(i).begin(),
                             [](float v) { return static_cast<std::uint8_t>(v); });
    else
      std::ranges::copy(from, surface_->sensor<float>(i).begin());
  }
  if (emergency_.active()) status_ |= kStopped;
  const double time_s = static_cast<double>(tick_) * device_->period_us * 1e-6;
  if (surface_->publish(tick_, time_s, status_) != Status::kOk) return;
  surface_->set_state(State::kRunning);
  if (options_.is_recorder_ready) options_.is_recorder_ready();
  ++counters_.frames;
  status_ = 0;
  awaiting_answer_ = options_.mode == Mode::kTimeStep;
  published_tick_ = tick_;
  published_device_tick_ = sequence_.tick();
  if (!awaiting_answer_) line_.write(SSW_HEARTBEAT, sequence_.tick());
}

void Bridge::log_lost_controller(Status why) {
  log_.add(std::string(shm_protocol::text(why)) +
           (options_.hold_last_frame ? "; its last frame stands" : "; safe values stand"));
}

void Bridge::poll_answer() {
  const Status answer = surface_->await_actuators(published_tick_, {kAnswerPoll, &stop_});
  switch (answer) {
    case Status::kTimeout:
    case Status::kInterrupted:
    case Status::kTorn:
      return;
    case Status::kControllerDead:
    case Status::kControllerClosed:
      log_lost_controller(answer);
      break;
    default:
      break;
  }
  awaiting_answer_ = false;
  if (may_send(published_tick_)) send_actuators(published_device_tick_, answer == Status::kOk);
}

void Bridge::poll_latest() {
  const Status newest = surface_->latest_actuators();
  if (newest == Status::kControllerDead || newest == Status::kControllerClosed) {
    log_lost_controller(newest);
    own_frame_due_ = true;
  }
  if (newest != Status::kOk) return;
  const std::uint64_t answered = surface_->actuator_info().tick;
  if (!may_send(answered)) return;
  send_actuators(sequence_.tick() - static_cast<std::uint32_t>(tick_ - answered), true);
}

// Whether safe values are to be in force that the device does not report to be. It then gets them in each
// period: any of its frames may be damaged on the line.
bool Bridge::needs_safe_frames() const {
  if (emergency_.active() && device_->version < 2) return true;  // later versions latch SSW_STOP_NOW
  return surface_->actuator_info().frame == 0 && !(flags_ & SSW_SAFE);
}

// The frame in effect, which no controller has sent; it waits until the line has taken earlier bytes.
void Bridge::send_own_frame() {
  if (!line_.is_open() || !may_send(tick_)) {
    own_frame_due_ = false;
    return;
  }
  if (!flush() || line_.pending_bytes() != 0) return;
  own_frame_due_ = false;
  send_actuators(sequence_.tick(), false);
}

void Bridge::fill_actuators() {
  const auto& channels = device_->channels;
  for (int i = 0; i < std::ssize(channels); ++i) {
    const DeviceChannel& c = channels[i];
    if (c.sensor) continue;
    float* const to = actuators_.data() + c.first_element;
    if (emergency_.active())
      std::fill_n(to, c.elements, c.safe);
    else if (c.is_plain_u8())
      std::ranges::copy(surface_->actuator<std::uint8_t>(i), to);
    else
      std::ranges::copy(surface_->actuator<float>(i), to);
  }
}

// An emergency stop sends the safe values in place of an answer.
void Bridge::send_actuators(std::uint32_t device_tick, bool is_answer) {
  fill_actuators();
  if (line_.write_frame(device_tick, actuators_, is_answer && !emergency_.active())) own_frame_due_ = false;
  flush();
}

void Bridge::check_emergency_stop() {
  if (!sequence_.known() || silent_) return;
  const bool was_active = emergency_.active();
  const std::uint8_t packet =
      emergency_.packet_for(flags_, sequence_.tick(), device_->period_us, release_, device_->name);
  if (!was_active && emergency_.active()) log_.add("emergency stop by the device");
  // Repeated each period until the device's frames show that it has arrived.
  if (packet == 0 || device_->version < 2 || stop_sent_tick_ == sequence_.tick()) return;
  stop_sent_tick_ = sequence_.tick();
  if (packet == SSW_STOP_NOW) line_.discard_pending();
  line_.write_reason(packet, packet == SSW_STOP_NOW ? emergency_.reason() : SSW_NONE);
  flush();
}

void Bridge::serve_control() {
  control_->serve([this](const std::string& command) { return answer(command); });
}

// A device that is not there gets the stop, or its release, with its first frames.
ControlAnswer Bridge::answer(const std::string& command) {
  if (command == "stop") {
    emergency_.stop(SSW_STOP_BY_HOST, "the user");
    log_.add("emergency stop by the user");
    if (line_.link().described()) {
      line_.discard_pending();
      if (device_->version >= 2) line_.write_reason(SSW_STOP_NOW, SSW_STOP_BY_HOST);
      line_.write_safe_frame(sequence_.tick());
      flush();
    }
    own_frame_due_ = false;
    return {"stopped\n"};
  }
  if (command == "arm") return {"armed\n", [this] { arm(); }};
  if (command == "status") return {status_text()};
  return {"error: unknown command\n"};
}

void Bridge::arm() {
  if (emergency_.active()) log_.add("the emergency stop is released");
  emergency_.arm();
  if (device_ && device_->version >= 2) release_ = EmergencyStop::Release(sequence_.tick());
  if (line_.link().described() && device_->version >= 2) {
    line_.write_reason(SSW_ARM, SSW_NONE);
    flush();
  }
}

std::string Bridge::status_text() const {
  const auto flag = [this](std::uint32_t bit, const char* name) {
    return (flags_ & bit) ? std::string(" ") + name : "";
  };
  const ssw_status& s = line_.link().status();
  const std::string name = device_ ? device_->name : options_.port.text;
  std::string text = "device " + name + " tick " + std::to_string(sequence_.tick()) + " frames " +
                     std::to_string(counters_.frames) + "\nemergency_stop " +
                     (emergency_.active() ? "by " + emergency_.cause() : std::string("none")) + "\nboard " +
                     (!device_ || device_->id.empty() ? name : device_->id) +
                     (!line_.is_open()                       ? " unplugged"
                      : silent_ || !line_.link().described() ? " silent"
                                                             : " live") +
                     flag(SSW_SAFE, "safe") + flag(SSW_STOPPED, "stopped") + flag(SSW_LIMITED, "limited") +
                     flag(SSW_SOFT_START, "soft_start") + " frames " + std::to_string(counters_.frames) +
                     " lost " + std::to_string(counters_.lost) + " dropped " + std::to_string(s.dropped) +
                     " clamped " + std::to_string(s.clamped) + " limited " + std::to_string(s.limited) + "\n";
  if (!device_) return text;
  for (const DeviceChannel& c : device_->channels)
    if (!c.sensor) text += limits_text(c);
  return text;
}

void Bridge::check_silence() {
  const auto now = Clock::now();
  const auto silence = silence_of(options_, device_->period_us);
  if (now - last_frame_ <= silence) return;
  if (!silent_) {
    enter_silence();
    ++counters_.silences;
    log_.add("the device has been silent for " + seconds(silence) + "; it is sent the safe frame");
  }
  send_handshake();
}

}  // namespace hardware
