#include "smartsurf/scene/SensorSpec.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "smartsurf/scene/ChannelKind.h"
#include "smartsurf/scene/ChannelName.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/scene/SceneSpec.h"

using namespace smartsurf::scene;

namespace {

std::string problem(const std::string& model, const ParameterValues& values) {
  SensorSpec spec = find_sensor_kind(model)->default_spec();
  for (const auto& [name, value] : values) spec.values[name] = value;
  return find_sensor_kind(model)->validate(spec);
}

}  // namespace

TEST(SensorKind, BuiltInDefaultsAreValid) {
  ASSERT_GE(sensor_kinds().size(), 6u);
  for (const SensorKind* built_in : sensor_kinds()) {
    const SensorKind& kind = *built_in;
    EXPECT_EQ(kind.validate(kind.default_spec()), "");
    const std::vector<SensorChannel> channels = kind.channels(kind.default_spec());
    ASSERT_FALSE(channels.empty());
    EXPECT_EQ(channels[0].name, kind.name);
    EXPECT_LT(kind.mask_channel, static_cast<int>(channels.size()));
    for (const SensorChannel& c : channels) {
      EXPECT_LT(c.minimum, c.maximum) << c.name;
      EXPECT_TRUE(c.no_detection >= c.minimum && c.no_detection <= c.maximum) << c.name;
      EXPECT_TRUE(c.components >= 1 && c.components <= 64) << c.name;
      EXPECT_LE(c.unit.size(), kMaxChannelUnitLength) << c.name;
    }
  }
}

TEST(ChannelName, LengthIsThatOfTheRule) {
  EXPECT_TRUE(is_channel_name(std::string(kMaxChannelNameLength, 'a')));
  EXPECT_FALSE(is_channel_name(std::string(kMaxChannelNameLength + 1, 'a')));
  EXPECT_TRUE(
      std::string(kChannelNameRule).starts_with("1 to " + std::to_string(kMaxChannelNameLength) + " "));
}

TEST(ChannelKind, FullNamesAreParsedToTheirKinds) {
  for (const ChannelKind kind : {ChannelKind::kSensor, ChannelKind::kCommand, ChannelKind::kRegister}) {
    const std::string name = full_name(kind, "height[0]");
    EXPECT_EQ(parse_channel(name).kind, kind) << name;
    EXPECT_EQ(parse_channel(name).name, "height[0]") << name;
  }
  EXPECT_EQ(full_name(ChannelKind::kCommand, "height"), "command: height");
  EXPECT_EQ(full_name(ChannelKind::kRegister, "A"), "apron:A");
  EXPECT_EQ(parse_channel("height").kind, ChannelKind::kHeight);
  EXPECT_EQ(parse_channel("apron").kind, ChannelKind::kSensor);
}

TEST(SensorKind, ErrorsNameTheField) {
  EXPECT_EQ(problem("proximity", {{"direction", {0, 0, 0}}}), "proximity.direction: must not be of length 0");
  EXPECT_EQ(problem("colour", {{"origin", {0, 1e9, 0}}}),
            "colour.origin[2] = 1000000000: must be in [-1000000, 1000000]");
  EXPECT_EQ(problem("light", {{"direction", {1, 0, 0}}}),
            "light.direction: must point up, to the light: its third number must be > 0");
  EXPECT_EQ(problem("light", {{"size", {2}}}), "light.size = 2: must be in [0, 0.785398163397]");
  EXPECT_EQ(problem("pressure", {{"range", {0}}}), "pressure.range = 0: must be greater than 0");
  EXPECT_EQ(problem("camera", {{"resolution", {5}}}), "camera.resolution = 5: must be in [1, 4]");
  EXPECT_EQ(problem("camera", {{"floor", {200}}}), "camera.floor = 200: must be below the height, 100");
  EXPECT_EQ(problem("proximity", {{"noise", {-1}}}), "proximity.noise = -1: must be in [0, 1000000]");
  EXPECT_EQ(problem("proximity", {{"dropout", {1.5}}}), "proximity.dropout = 1.5: must be in [0, 1]");
  EXPECT_EQ(problem("proximity", {{"false_hits", {0.1}}}), "");
  EXPECT_EQ(problem("colour", {{"false_hits", {0.1}}}),
            "colour.false_hits = 0.1: must be 0: the sensor has no channel of detections");
  EXPECT_EQ(problem("proximity", {{"dead", {0.5}}, {"stuck_low", {0.6}}}),
            "proximity: stuck_low, stuck_high and dead add up to 1.1: must be at most 1");
}

TEST(SensorKind, AddsKinds) {
  const auto count = sensor_kinds().size();
  add_sensor_kind({.name = "smell", .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
                     return {{.name = s.name}};
                   }});
  ASSERT_EQ(sensor_kinds().size(), count + 1);
  EXPECT_EQ(collect_channels(std::vector<SensorSpec>{find_sensor_kind("smell")->default_spec()})[0].name,
            "smell");
  EXPECT_EQ(find_sensor_kind("taste"), nullptr);
}
