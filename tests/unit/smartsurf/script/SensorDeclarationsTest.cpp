#include "tests/unit/smartsurf/script/ScriptFixture.h"

namespace smartsurf::script {
namespace {

using SensorTest = ScriptTest;

TEST_F(SensorTest, EveryKindReadsItsFields) {
  write("calib.csv", "row,column,channel,gain,offset\n0,0,side,1.1,0\n");
  const Experiment e = load(R"(surface{rows = 4, columns = 6, sensors = {
    proximity{name = 'side', range = 3, direction = {2, 0, 0}, origin = {0, 0, 0.5}, pins = false,
              noise = 0.1, quantize = 0.01, latency = 2, dropout = 0.001, drift = 0.2, stuck_low = 0.01, dead = 0.02,
              calibration = 'calib.csv'},
    colour{}, object_type{range = 4}, light{direction = {1, 0, 1}, size = 0.1, samples = 8},
    pressure{range = 500}, camera{resolution = 2, height = 50, floor = -1}}})");
  const auto& sensors = e.scene().surface.sensors;
  ASSERT_EQ(sensors.size(), 6u);
  EXPECT_EQ(sensors[0].model, "proximity");
  EXPECT_EQ(sensors[0].name, "side");
  EXPECT_EQ(sensors[0].vector("direction"), Eigen::Vector3d(2, 0, 0));
  EXPECT_EQ(sensors[0].vector("origin"), Eigen::Vector3d(0, 0, 0.5));
  EXPECT_EQ(sensors[0].number("pins"), 0.0);
  EXPECT_EQ(sensors[0].number("noise"), 0.1);
  EXPECT_EQ(sensors[0].number("latency"), 2.0);
  EXPECT_EQ(sensors[0].number("dead"), 0.02);
  EXPECT_EQ(sensors[0].calibration->text, "row,column,channel,gain,offset\n0,0,side,1.1,0\n");
  EXPECT_TRUE(sensors[0].calibration->name.ends_with("calib.csv"));
  EXPECT_EQ(sensors[1].number("range"), 8.0);
  EXPECT_EQ(sensors[1].number("pins"), 1.0);
  EXPECT_FALSE(sensors[1].has("noise"));
  EXPECT_EQ(sensors[3].number("samples"), 8.0);
  EXPECT_EQ(sensors[4].number("range"), 500.0);
  EXPECT_EQ(sensors[5].number("resolution"), 2.0);
  EXPECT_EQ(e.scene().surface.sensor_channels(),
            (std::vector<std::string>{"side", "side_hit", "colour", "object_type", "light", "pressure",
                                      "camera", "camera_height"}));
}

TEST_F(SensorTest, FaultsApplyToAllSensors) {
  const Experiment e =
      load("surface{sensors = {proximity{}}}\nfaults{sensor = {noise = 0.05, stuck_high = 0.01}}");
  EXPECT_EQ(e.scene().surface.faults.sensor_errors.at("noise"), (std::vector<double>{0.05}));
  EXPECT_EQ(e.scene().surface.faults.sensor_errors.at("stuck_high"), (std::vector<double>{0.01}));
}

TEST_F(SensorTest, SenseAndTruthReturnAllComponents) {
  Experiment e = load(R"(surface{rows = 4, columns = 6, sensors = {colour{}, proximity{}}}
    at(0, function()
      print(select('#', cells:sense('colour', 2, 3)), cells:sense('colour', 2, 3))
      print(select('#', cells:sense('proximity', 2, 3)), cells:truth('proximity', 2, 3))
    end))");
  FakeSimulation simulation(e.scene());
  e.start(simulation);
  e.tick(0.0, 0);
  EXPECT_EQ(printed, "3\t60102.0\t60102.25\t60102.5\n1\t-90102.0\n");
}

TEST_F(SensorTest, EmptyCellsAddOccupancyChannel) {
  Experiment e = load(R"(surface{rows = 2, columns = 2, mask = {{true, false}, {true, true}}}
on_tick(function() print(cells:sense('occupancy', 1, 1), cells:sense('occupancy', 1, 2), cells:truth('occupancy', 2, 2)) end))");
  FakeSimulation simulation(e.scene());
  e.start(simulation);
  e.tick(0.0, 0);
  EXPECT_EQ(printed, "1.0\t0.0\t1.0\n");
}

TEST_F(SensorTest, FullSurfaceHasNoOccupancyChannel) {
  EXPECT_EQ(error_of("surface{sensors = {colour{name = 'occupancy'}}}"), "");
  EXPECT_EQ(
      error_of(
          "surface{mask = {{false, true}}, rows = 1, columns = 2, sensors = {colour{name = 'occupancy'}}}"),
      "t.lua:1: surface.sensors: the name 'occupancy' is taken by the mask of a surface with empty cells");
  const std::string thirty_one =
      "local s = {} for i = 1, 31 do s[i] = colour{name = 'c' .. i} end surface{rows = 1, columns = 2, "
      "sensors = s";
  EXPECT_EQ(error_of(thirty_one + "}"), "");
  EXPECT_EQ(
      error_of(thirty_one + ", mask = {{false, true}}}"),
      "t.lua:1: surface.sensors: 32 sensor channels beside 1 of actuators: must be at most 32 together");
}

TEST_F(SensorTest, InvalidSensors) {
  const auto error = [this](const std::string& sensor) {
    return error_of("surface{sensors = {" + sensor + "}}");
  };
  EXPECT_EQ(error("colour{rang = 3}"), "t.lua:1: colour: unknown field 'rang' (did you mean 'range'?)");
  EXPECT_EQ(error("proximity{direction = 3}"),
            "t.lua:1: proximity.direction = 3: must be three numbers {x, y, z}");
  EXPECT_EQ(error("proximity{direction = {0, 0, 0}}"),
            "t.lua:1: proximity.direction: must not be of length 0");
  EXPECT_EQ(error("proximity{pins = 1}"), "t.lua:1: proximity.pins = 1: must be true or false");
  EXPECT_EQ(error("proximity{noise = -1}"), "t.lua:1: proximity.noise = -1: must be in [0, 1000000]");
  EXPECT_EQ(error("proximity{latency = 1.5}"),
            "t.lua:1: proximity.latency = 1.5: must be an integer from 0 to 100");
  EXPECT_EQ(error("proximity{calibration = 'none.csv'}"),
            "t.lua:1: proximity.calibration: 'none.csv' does not exist");
  EXPECT_EQ(error("proximity{calibration = '../x.csv'}"),
            "t.lua:1: proximity.calibration: '../x.csv' is outside the script's folder and the output "
            "folder; --unsafe "
            "allows it");
  EXPECT_EQ(error("light{direction = {1, 0, -1}}"),
            "t.lua:1: light.direction: must point up, to the light: its third number must be > 0");
  EXPECT_EQ(error("camera{resolution = 8}"),
            "t.lua:1: camera.resolution = 8: must be an integer from 1 to 4");
  const std::string longest(24, 'c');
  EXPECT_EQ(error("camera{name = '" + longest + "'}"), "");
  for (const char* more : {"c", "ccc", "cccc"})
    EXPECT_EQ(error("camera{name = '" + longest + more + "'}"),
              "t.lua:1: camera.name = '" + longest + more +
                  "': must be 1 to 24 letters, digits and _, a letter first")
        << "with '_height' at most 31";
  EXPECT_EQ(error("pressure{direction = {1, 0, 0}}").substr(0, 47),
            "t.lua:1: pressure: unknown field 'direction'; k");
  EXPECT_EQ(error_of("surface{} faults{sensor = {noise = 'loud'}}"),
            "t.lua:1: faults.sensor.noise = 'loud': must be a number");
  EXPECT_EQ(error_of("surface{} faults{sensor = {nois = 1}}"),
            "t.lua:1: faults.sensor: unknown field 'nois' (did you mean 'noise'?)");
  EXPECT_EQ(error_of("surface{} faults{sensor = {dropout = 2}}"),
            "t.lua:1: faults.sensor.dropout = 2: must be in [0, 1]");
}

}  // namespace
}  // namespace smartsurf::script
