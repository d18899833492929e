// The list of what a scene consists of, with a search. No OpenGL.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/view/model/FrameInput.h"
#include "smartsurf/view/model/SceneItem.h"

namespace smartsurf::view {

struct Entity {
  enum class Kind { kChannel, kCell, kObject };
  Kind kind = Kind::kObject;
  std::string name;     // as listed: "12 ball, sphere", "proximity [u]", "cell 4,7"
  SceneItem item;       // kObject, kCell
  std::string channel;  // kChannel
};

class EntityList {
 public:
  // The entities that match all words of the query, regardless of case: the channels of sensors and
  // actuators, then the objects of the frame in order of id. "4,7" adds that cell first. Rebuilt only when
  // the query or the set of objects has changed. The result is valid until the next call.
  const std::vector<Entity>& find(std::string_view query, const scene::SurfaceSpec& surface,
                                  const FrameInput& input);

 private:
  std::string query_;
  std::vector<scene::ObjectId> ids_;
  std::size_t channel_count_ = 0;
  bool built_ = false;
  std::vector<Entity> entities_;
};

// "sphere", "box", …
const char* shape_name(scene::ShapeKind shape);

}  // namespace smartsurf::view
