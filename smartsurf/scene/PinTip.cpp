#include "smartsurf/scene/PinTip.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace smartsurf::scene {

PinTip pin_tip(const ActuatorSpec& pin, double top_x, double top_y) {
  const auto value_or = [&](const char* parameter, double otherwise) {
    return static_cast<float>(pin.has(parameter) ? pin.number(parameter) : otherwise);
  };
  const double shorter_edge = std::min(top_x, top_y);
  PinTip tip{static_cast<TipShape>(static_cast<int>(pin.number("tip.shape")))};
  switch (tip.shape) {
    case TipShape::kFlat:
      break;
    case TipShape::kHemisphere:
      tip.radius = tip.height = value_or("tip.radius", 0.5 * shorter_edge);
      break;
    case TipShape::kCone:
      tip.radius = value_or("tip.radius", 0.5 * shorter_edge);
      tip.height = tip.radius / std::tan(value_or("tip.half_angle", 0.25 * std::numbers::pi));
      break;
    case TipShape::kRoundedSquare:
      tip.radius = value_or("tip.corner_radius", 0.25 * shorter_edge);
      break;
  }
  return tip;
}

}  // namespace smartsurf::scene
