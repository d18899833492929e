// The tip of a pin: its upper end.
#pragma once

#include "smartsurf/scene/ActuatorSpec.h"

namespace smartsurf::scene {

// The values of `pin.tip.shape`.
enum class TipShape { kFlat, kHemisphere, kCone, kRoundedSquare };

struct PinTip {
  TipShape shape = TipShape::kFlat;
  float radius = 0.0F;  // of a hemisphere, of a cone's foot, of a rounded square's corners, u
  float height = 0.0F;  // of a hemisphere or a cone, from its foot to its highest point, u
};

// With the defaults filled in. pin: of the model "pin"; top_x, top_y: edges of the cells' tops, u.
PinTip pin_tip(const ActuatorSpec& pin, double top_x, double top_y);

}  // namespace smartsurf::scene
