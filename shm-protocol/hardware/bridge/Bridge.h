// The surface role for a physical device: forwards sensor frames to the controller and actuator frames to the
// device, paced by the device's clock.
//
// Single-threaded. Events are logged line by line, recurring ones at most once a second.
#pragma once

#include <shm_protocol/SurfaceEndpoint.h>
#include <shm_protocol/SurfaceName.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "shm-protocol/hardware/bridge/ControlSocket.h"
#include "shm-protocol/hardware/bridge/DeviceLine.h"
#include "shm-protocol/hardware/bridge/EmergencyStop.h"
#include "shm-protocol/hardware/bridge/EventLog.h"
#include "shm-protocol/hardware/bridge/FrameSequence.h"

namespace hardware {

// FrameInfo::status of the sensor frames that a bridge publishes.
enum FrameStatus : std::uint32_t {
  kMissedDeadline = 1,    // a control period before this frame ended without the controller's answer
  kFramesLost = 2,        // earlier frames of the device were lost or skipped
  kSafeValuesActive = 4,  // the device holds its safe values
  kAfterSilence = 8,      // the first frame after the device was silent or unplugged
  kStopped = 16,          // an emergency stop is in effect
  kLimited = 32,          // a limit of the device held back an actuator
  kSoftStart = 64,        // the actuators approach their first targets slowly
  kBoardNotValid = 128    // cells of a table are not valid: see its channel `valid`
};

struct BridgeOptions {
  PortAddress port;
  std::string surface = "surface";
  shm_protocol::Mode mode = shm_protocol::Mode::kTimeStep;
  std::optional<std::uint64_t> ticks;                 // frames to publish; nullopt: unlimited
  std::chrono::milliseconds silence_timeout{500};     // without a sensor frame until the device is silent
  std::chrono::milliseconds connect_timeout{10'000};  // wait for the device at start-up
  std::optional<std::chrono::milliseconds> reconnect_timeout;  // wait for a lost device; nullopt: unlimited
  // Whether the session's recorder is attached, or has ended. Asked before the device starts, which waits for
  // it, five seconds at most, and with each frame. Empty: there is none.
  std::function<bool()> is_recorder_ready;
  bool hold_last_frame = false;  // without a controller: keep the last frame (true) or send the safe values
};

constexpr std::chrono::seconds kRecorderPatience{5};  // until a session begins without its recorder

// How long a device of that period sends no frame until it is silent: at least four periods.
std::chrono::microseconds silence_of(const BridgeOptions&, std::uint32_t period_us);

struct BridgeCounters {
  std::uint64_t frames = 0;   // sensor frames published
  std::uint64_t answers = 0;  // actuator frames of a controller sent to the device
  std::uint64_t lost = 0;     // sensor frames that did not arrive completely
  std::uint64_t skipped = 0;  // complete sensor frames that a newer one replaced before they were published
  std::uint64_t missed_deadlines = 0;
  std::uint64_t unsent = 0;         // actuator frames dropped because the line is too slow
  std::uint64_t silences = 0;       // times the device fell silent
  std::uint64_t reconnections = 0;  // times the line was lost and restored
  std::uint64_t damaged_packets = 0, lost_packets = 0;
};

// A line of `surface_bridge status`; empty if the device limits nothing.
std::string limits_text(const DeviceChannel&);

// Reserves the name of a surface before its device comes. Throws std::invalid_argument with one line that
// begins with `where` if the name is bad or in use, or shm_protocol::Error.
std::shared_ptr<shm_protocol::SurfaceName> reserve_surface(const std::string& name, const std::string& where);

// Throws std::runtime_error that begins with `who`, whose description it is, if that is of no surface; else
// as create() does.
shm_protocol::SurfaceEndpoint create_described_surface(const shm_protocol::SurfaceConfig&,
                                                       const std::string& who);

enum class Outcome { kDone, kStopped, kDeviceLost, kFailed };

class Bridge {
 public:
  using Clock = std::chrono::steady_clock;

  // Throws as reserve_surface() does.
  Bridge(BridgeOptions, const std::atomic<bool>& stop, EventLog::Print);

  // Connects, creates the surface and serves until all ticks are published (kDone), the stop flag is raised
  // (kStopped), the device does not appear or return in time (kDeviceLost), or it is unusable (kFailed). The
  // last two are logged. Throws shm_protocol::Error if the surface cannot be created. Finally commands the
  // device to hold its safe values.
  Outcome run();

  const BridgeCounters& counters() const { return counters_; }

 private:
  bool open_line(std::string& why);
  template <class Lost>
  std::optional<Outcome> await_device(std::optional<std::chrono::milliseconds> timeout, Lost lost);
  std::optional<Outcome> connect();
  std::optional<Outcome> reconnect();
  std::optional<Outcome> end_of_fault();
  void create_surface();
  void await_recorder();
  std::optional<Outcome> serve_once();
  bool poll_line(std::chrono::milliseconds timeout);
  void on_event(DeviceLink::Event);
  void on_description();
  void on_frame();
  void count_missed_deadlines(std::uint32_t missed);
  void publish();
  void log_lost_controller(shm_protocol::Status);
  void poll_answer();
  void poll_latest();
  void send_actuators(std::uint32_t device_tick, bool is_answer);
  bool needs_safe_frames() const;
  void send_own_frame();
  void check_silence();
  void send_handshake();
  void on_line_lost(const std::string& reason);
  void enter_silence();
  bool may_send(std::uint64_t answered_tick) const;
  void send_stop();
  void fill_actuators();
  void check_emergency_stop();
  void serve_control();
  ControlAnswer answer(const std::string& command);
  void arm();
  std::string status_text() const;
  bool flush();
  void count_line();

  BridgeOptions options_;
  const std::atomic<bool>& stop_;
  EventLog log_;
  DeviceLine line_;
  std::future<std::pair<std::optional<Port>, std::string>> opening_;
  std::optional<DeviceDescription> device_;  // as first described
  std::shared_ptr<shm_protocol::SurfaceName> name_;
  std::optional<shm_protocol::SurfaceEndpoint> surface_;
  std::optional<ControlSocket> control_;
  EmergencyStop emergency_;
  EmergencyStop::Release release_;    // of the device
  unsigned handshakes_ = 0;           // since the line was opened
  std::uint32_t stop_sent_tick_ = 0;  // of the device, when the last SSW_STOP_NOW or SSW_ARM was sent
  std::uint32_t flags_ = 0;           // of the newest sensor frame
  std::vector<float> actuators_;      // the frame being sent to the device
  std::string fault_;                 // why the device is unusable; "": it is usable

  FrameSequence sequence_;
  std::uint64_t tick_ = 0;  // of the newest sensor frame, within the session
  std::uint32_t boot_id_ = 0;
  std::uint32_t status_ = 0;      // FrameStatus of the next frame
  bool frame_ready_ = false;      // a frame waits to be published
  bool awaiting_answer_ = false;  // time-step: the last published frame is unanswered
  bool has_begun_ = false;        // frames are published
  bool own_frame_due_ = false;    // the device needs the frame in effect, which no controller has sent
  std::uint64_t published_tick_ = 0;
  std::uint32_t published_device_tick_ = 0;
  bool silent_ = false;
  std::optional<std::uint64_t> stale_tick_;  // answers to this and older ticks are not sent
  Clock::time_point last_frame_{}, last_handshake_{};
  BridgeCounters counters_;
};

}  // namespace hardware
