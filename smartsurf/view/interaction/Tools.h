// The pointer tools: select, pull an object with a spring, drop an object, poke a cell, break a cell.
// Converts pointer rays to requests. Independent of the window system and OpenGL.
#pragma once

#include <optional>
#include <utility>

#include "smartsurf/view/interaction/Picking.h"

namespace smartsurf::view {

// A spring pulls the object's local_anchor to `target`.
struct Pull {
  scene::ObjectId object = 0;
  Eigen::Vector3d local_anchor{0.0, 0.0, 0.0};  // object frame, u
  Eigen::Vector3d target{0.0, 0.0, 0.0};        // world frame, u
};

// Holds a cell at a height.
struct Poke {
  int row = 0, column = 0;
  double height = 0.0;  // z of the top, u
};

enum class FaultKind { kNone, kStuck, kDead };

// Puts a cell into a fault state. kNone repairs it.
struct Fault {
  int row = 0, column = 0;
  FaultKind kind = FaultKind::kNone;
};

enum class Tool { kPick, kDrop, kPoke, kBreak };

// The object that the drop tool creates.
struct DropSpec {
  scene::ShapeKind shape = scene::ShapeKind::kSphere;
  double size = 1.0;    // radius or half edge, u
  double height = 4.0;  // drop height above the clicked point, u
  scene::Colour colour{0.85f, 0.55f, 0.10f};
};

class Tools {
 public:
  explicit Tools(const scene::SurfaceSpec& surface);

  Tool active_tool = Tool::kPick;
  DropSpec drop_spec;
  FaultKind fault_kind = FaultKind::kStuck;
  double poke_height;  // u

  // Pointer press and move along a view ray. pull: pull the object under the pointer, whatever the active
  // tool. press() returns whether the tool takes the following drag; if not, the drag moves the camera.
  bool press(const Ray& ray, const FrameInput& input, bool pull);
  void move(const Ray& ray, const FrameInput& input);
  void release();
  // Selects what the ray hits; clears the selection if it hits nothing.
  void select(const Ray& ray, const FrameInput& input);
  void select(const std::optional<SceneItem>& item) { selected_ = item; }
  void cancel();  // returns to the pick tool, or clears the selection if it is active

  const std::optional<SceneItem>& selected() const { return selected_; }
  const std::optional<Pull>& pull() const { return pull_; }
  const std::optional<Poke>& poke() const { return poke_; }
  // Return each request once.
  std::optional<scene::ObjectSpec> take_drop() { return std::exchange(drop_request_, std::nullopt); }
  std::optional<Fault> take_fault() { return std::exchange(fault_request_, std::nullopt); }

  // World position of the pull's anchor, u. The target if the object is gone.
  static Eigen::Vector3d anchor_position(const Pull& pull, const scene::Snapshot& snapshot);

 private:
  void start_pull(const PickHit& hit, const Ray& ray, const FrameInput& input);
  void request_drop(const Eigen::Vector3d& point);

  scene::SurfaceSpec surface_;
  std::optional<SceneItem> selected_;
  std::optional<Pull> pull_;
  Eigen::Vector3d pull_plane_normal_{0.0, 0.0, 1.0};  // of the plane in which the target moves
  std::optional<Poke> poke_;
  std::optional<scene::ObjectSpec> drop_request_;
  std::optional<Fault> fault_request_;
};

}  // namespace smartsurf::view
