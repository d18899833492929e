// The interface of a physics engine under benchmark: simulates the objects of a workload on moving pins.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "tests/bench/PinScene.h"

class PinEngine {
 public:
  virtual ~PinEngine() = default;

  // Advances by kStepSeconds. heights: of all pins at the end of the step in u, row-major, row 0 north.
  virtual void step(const std::vector<float>& heights) = 0;
  // Casts a vertical ray of length kSensorRange from the top of each pin.
  virtual void sense(const std::vector<float>& heights) = 0;
  virtual Eigen::Vector3d position(std::size_t object) const = 0;
};

// Null if the engine is not built in or does not support the workload.
std::unique_ptr<PinEngine> make_mujoco_pins(const pin_scene::Workload&, const std::string& cone);
std::unique_ptr<PinEngine> make_ode_pins(const pin_scene::Workload&);
