// The pointer tools: pick, pull with a spring, drop, poke a cell, break a cell. Events arrive as plain calls,
// requests come out; no window and no OpenGL.
#pragma once

#include <optional>
#include <utility>

#include "smartsurf/view/interaction/Picking.h"

namespace smartsurf::view {

// The object is drawn by a spring from the point `grip` of it to the point `target`.
struct Pull {
  scene::ObjectId object = 0;
  Eigen::Vector3d local_anchor{0.0, 0.0, 0.0};  // in the object's own frame, u
  Eigen::Vector3d target{0.0, 0.0, 0.0};        // in the world, u
};

// The cell is to stand at that height for as long as it is poked.
struct Poke {
  int row = 0, column = 0;
  double height = 0.0;  // u
};

// What can be wrong with a cell.
enum class FaultKind { kNone, kStuck, kDead };

struct Fault {
  int row = 0, column = 0;
  FaultKind kind = FaultKind::kNone;  // kNone: mended
};

enum class Tool { kPick, kDrop, kPoke, kBreak };

// What the drop tool makes.
struct DropSpec {
  scene::ShapeKind shape = scene::ShapeKind::kSphere;
  double size = 1.0;    // radius, or half an edge, u
  double height = 4.0;  // of the fall, u
  scene::Colour colour{0.85f, 0.55f, 0.10f};
};

class Tools {
 public:
  explicit Tools(const scene::SurfaceSpec& surface);

  Tool active_tool = Tool::kPick;
  DropSpec drop_spec;
  FaultKind fault_kind = FaultKind::kStuck;
  double poke_height;  // u

  // The pointer goes down or moves on that line of sight. pull: what is meant is to pull objects, whatever
  // the tool. press() says whether the tool takes the drag to come; else it moves the camera.
  bool press(const Ray& ray, const FrameInput& input, bool pull);
  void move(const Ray& ray, const FrameInput& input);
  void release();
  // A double click, or a click that moved nothing.
  void select(const Ray& ray, const FrameInput& input);
  void select(const std::optional<SceneItem>& item) { selected_ = item; }
  void cancel();  // puts down the tool and what it holds, then the selection

  const std::optional<SceneItem>& selected() const { return selected_; }
  const std::optional<Pull>& pull() const { return pull_; }
  const std::optional<Poke>& poke() const { return poke_; }
  // Once each.
  std::optional<scene::ObjectSpec> take_drop() { return std::exchange(drop_request_, std::nullopt); }
  std::optional<Fault> take_fault() { return std::exchange(fault_request_, std::nullopt); }

  // Where the gripped point is now, to draw the spring from.
  static Eigen::Vector3d anchor_position(const Pull& pull, const scene::Snapshot& snapshot);

 private:
  void start_pull(const PickHit& hit, const Ray& ray, const FrameInput& input);
  void request_drop(const Eigen::Vector3d& point);

  scene::SurfaceSpec surface_;
  std::optional<SceneItem> selected_;
  std::optional<Pull> pull_;
  Eigen::Vector3d pull_plane_normal_{0.0, 0.0, 1.0};  // normal of the plane in which the target moves
  std::optional<Poke> poke_;
  std::optional<scene::ObjectSpec> drop_request_;
  std::optional<Fault> fault_request_;
};

}  // namespace smartsurf::view
