// What tests of the protocol share; raw access to a segment's bytes, to corrupt, compare and forge them.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <shm_protocol/layout.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <string>
#include <vector>

namespace shm_protocol {

inline constexpr WaitOptions kNoWait{.timeout = std::chrono::nanoseconds(0)};

inline std::string file_path(const std::string& name) { return "/dev/shm/smartsurf." + name; }

inline bool exists(const std::string& path) { return ::access(path.c_str(), F_OK) == 0; }

class RawSegment {
 public:
  explicit RawSegment(const std::string& name) {
    const int file = ::open(file_path(name).c_str(), O_RDWR);
    struct stat status {};
    if (file < 0 || ::fstat(file, &status) != 0) throw std::runtime_error("no segment " + name);
    bytes_ = static_cast<std::size_t>(status.st_size);
    memory_ = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    ::close(file);
    if (memory_ == MAP_FAILED) throw std::runtime_error("cannot map " + name);
    geometry_ = header().geometry;
    mode_ = header().identity.mode;
  }
  ~RawSegment() { ::munmap(memory_, bytes_); }
  RawSegment(const RawSegment&) = delete;
  RawSegment& operator=(const RawSegment&) = delete;

  ssp_header& header() { return *static_cast<ssp_header*>(memory_); }
  std::uint8_t* data() { return static_cast<std::uint8_t*>(memory_); }
  std::size_t size() const { return bytes_; }
  std::vector<std::uint8_t> copy() { return {data(), data() + size()}; }
  ssp_slot& sensor_slot(std::uint64_t frame) {
    const auto& g = geometry_;
    return *reinterpret_cast<ssp_slot*>(data() + g.sensor_ring_offset +
                                        frame % in_use(g.sensor_slots) * g.sensor_slot_bytes);
  }
  ssp_slot& actuator_slot(std::uint64_t frame) {
    const auto& g = geometry_;
    return *reinterpret_cast<ssp_slot*>(data() + g.actuator_ring_offset +
                                        frame % in_use(g.actuator_slots) * g.actuator_slot_bytes);
  }

 private:
  std::uint32_t in_use(std::uint32_t slots) const { return mode_ == SSP_MODE_TIME_STEP ? 2 : slots; }

  void* memory_ = nullptr;
  std::size_t bytes_ = 0;
  ssp_geometry geometry_{};  // initial value
  std::uint32_t mode_ = 0;
};

// A file with the given bytes under a segment's name; removed by the destructor.
class ForgedSegment {
 public:
  ForgedSegment(std::string name, const std::vector<std::uint8_t>& bytes) : name_(std::move(name)) {
    write(bytes);
  }
  ~ForgedSegment() { ::unlink(file_path(name_).c_str()); }
  ForgedSegment(const ForgedSegment&) = delete;
  ForgedSegment& operator=(const ForgedSegment&) = delete;

  void write(const std::vector<std::uint8_t>& bytes) {
    const int file = ::open(file_path(name_).c_str(), O_RDWR | O_CREAT | O_TRUNC, 0600);
    ASSERT_GE(file, 0);
    ASSERT_EQ(::write(file, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    ::close(file);
  }
  const std::string& name() const { return name_; }

 private:
  std::string name_;
};

// Distinct for every test process, so that tests can run in parallel.
inline std::string unique_name(const std::string& what) {
  return "test-" + what + "-" + std::to_string(::getpid());
}

constexpr int kDistance = 0, kColour = 1, kFlags = 2, kHeight = 3, kLamp = 4, kValve = 5;

inline SurfaceConfig small_surface(const std::string& name, Mode mode = Mode::kTimeStep) {
  SurfaceConfig config;
  config.name = name;
  config.rows = 5;
  config.columns = 7;
  config.pitch = 1.5;
  config.period_ns = 16'666'667;
  config.mode = mode;
  config.channels = {{"distance", Direction::kSensor, DType::kF32, 1, "u", 0, 8, 8},
                     {"colour", Direction::kSensor, DType::kU8, 3, "", 0, 255, 0},
                     {"flags", Direction::kSensor, DType::kU32, 1, "", 0, 4294967295.0, 0},
                     {"height", Direction::kActuator, DType::kF32, 1, "u", -1, 4, 0.5},
                     {"lamp", Direction::kActuator, DType::kU8, 1, "", 0, 100, 7},
                     {"valve", Direction::kActuator, DType::kU32, 2, "", 10, 20, 11}};
  return config;
}

// The code of the Error that `action` throws; fails the test if it throws none.
template <class Action>
ErrorCode error_of(Action&& action, std::string* message = nullptr, std::uint32_t* pid = nullptr) {
  try {
    action();
  } catch (const Error& e) {
    if (message) *message = e.what();
    if (pid) *pid = e.pid();
    return e.code();
  }
  ADD_FAILURE() << "no error was thrown";
  return ErrorCode{-1};
}

}  // namespace shm_protocol
