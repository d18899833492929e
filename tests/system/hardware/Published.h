#pragma once

#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>

namespace hardware {

// Publishes the controller's frame. If a device cannot be stopped, the bridge gives up a frame whose answer
// comes too late.
inline testing::AssertionResult published(shm_protocol::ControllerEndpoint& controller) {
  using shm_protocol::Status;
  const Status status = controller.publish();
  if (status == Status::kOk || status == Status::kTorn) return testing::AssertionSuccess();
  return testing::AssertionFailure() << text(status);
}

}  // namespace hardware
