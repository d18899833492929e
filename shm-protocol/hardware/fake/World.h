// A simulated surface as the world under emulated boards: what they command moves it, and what it senses is
// what their sensors say.
#pragma once

#include <shm_protocol/ControllerEndpoint.h>

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "shm-protocol/hardware/fake/EmulatedDevice.h"

namespace hardware {

class WorldDevice;

class World {
 public:
  // Becomes the controller of that surface, and waits for it. Throws std::runtime_error if there is none, and
  // std::invalid_argument if boards cannot be what it describes.
  World(const std::string& name, const std::atomic<bool>& stop);

  const shm_protocol::Description& description() const { return endpoint_.description(); }
  std::uint32_t period_us() const {
    return static_cast<std::uint32_t>((description().period_ns + 500) / 1000);
  }

  // Steps one control period under the boards' active frames. The world begins with the first frame that a
  // host sends to the first board. Throws std::runtime_error if the surface dies.
  void step();
  // The surface has closed.
  bool has_ended() const { return has_ended_; }
  std::uint64_t steps() const { return steps_; }

 private:
  friend class WorldDevice;
  void await();

  shm_protocol::ControllerEndpoint endpoint_;
  const std::atomic<bool>& stop_;
  std::vector<WorldDevice*> boards_;
  std::uint64_t steps_ = 0;
  bool has_begun_ = false, has_ended_ = false;
};

// A board over some of the world's cells. Its channels are the world's, unchanged.
class WorldDevice final : public EmulatedDevice {
 public:
  WorldDevice(World&, std::uint32_t first_row, std::uint32_t first_column, std::uint16_t rows,
              std::uint16_t columns, Write);

 private:
  friend class World;
  struct Plane {
    int channel;                      // of the world
    std::vector<std::uint8_t> cells;  // sensors: what the board sends
  };
  void reset() override {}
  void sense(std::uint64_t tick) override;
  void command();
  // visit(offset in the world's plane, offset in the board's, bytes), for each row of the board.
  template <class Visit>
  void for_each_row(const shm_protocol::ChannelSpec&, Visit visit) const;

  World& world_;
  const std::uint32_t first_row_, first_column_;
  std::vector<Plane> sensors_, actuators_;
};

}  // namespace hardware
