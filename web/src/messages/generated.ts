// Written by `python tools/typescript_messages.py` from the definitions of the messages.
// A test of the project fails when this file is older than they are.

export interface builtin_interfaces_Duration {
  sec: number;
  nanosec: number;
}

export interface builtin_interfaces_Time {
  sec: number;
  nanosec: number;
}

export interface diagnostic_msgs_DiagnosticArray {
  header: std_msgs_Header;
  status: diagnostic_msgs_DiagnosticStatus[];
}

export interface diagnostic_msgs_DiagnosticStatus {
  level: number;
  name: string;
  message: string;
  hardware_id: string;
  values: diagnostic_msgs_KeyValue[];
}

export const diagnostic_msgs_DiagnosticStatus_ = {
  OK: 0,
  WARN: 1,
  ERROR: 2,
  STALE: 3,
} as const;

export interface diagnostic_msgs_KeyValue {
  key: string;
  value: string;
}

export interface geometry_msgs_Accel {
  linear: geometry_msgs_Vector3;
  angular: geometry_msgs_Vector3;
}

export interface geometry_msgs_AccelStamped {
  header: std_msgs_Header;
  accel: geometry_msgs_Accel;
}

export interface geometry_msgs_AccelWithCovariance {
  accel: geometry_msgs_Accel;
  covariance: Float64Array | number[];
}

export interface geometry_msgs_AccelWithCovarianceStamped {
  header: std_msgs_Header;
  accel: geometry_msgs_AccelWithCovariance;
}

export interface geometry_msgs_Inertia {
  m: number;
  com: geometry_msgs_Vector3;
  ixx: number;
  ixy: number;
  ixz: number;
  iyy: number;
  iyz: number;
  izz: number;
}

export interface geometry_msgs_InertiaStamped {
  header: std_msgs_Header;
  inertia: geometry_msgs_Inertia;
}

export interface geometry_msgs_Point {
  x: number;
  y: number;
  z: number;
}

export interface geometry_msgs_Point32 {
  x: number;
  y: number;
  z: number;
}

export interface geometry_msgs_PointStamped {
  header: std_msgs_Header;
  point: geometry_msgs_Point;
}

export interface geometry_msgs_Polygon {
  points: geometry_msgs_Point32[];
}

export interface geometry_msgs_PolygonInstance {
  polygon: geometry_msgs_Polygon;
  id: number | bigint;
}

export interface geometry_msgs_PolygonInstanceStamped {
  header: std_msgs_Header;
  polygon: geometry_msgs_PolygonInstance;
}

export interface geometry_msgs_PolygonStamped {
  header: std_msgs_Header;
  polygon: geometry_msgs_Polygon;
}

export interface geometry_msgs_Pose {
  position: geometry_msgs_Point;
  orientation: geometry_msgs_Quaternion;
}

export interface geometry_msgs_Pose2D {
  x: number;
  y: number;
  theta: number;
}

export interface geometry_msgs_PoseArray {
  header: std_msgs_Header;
  poses: geometry_msgs_Pose[];
}

export interface geometry_msgs_PoseStamped {
  header: std_msgs_Header;
  pose: geometry_msgs_Pose;
}

export interface geometry_msgs_PoseWithCovariance {
  pose: geometry_msgs_Pose;
  covariance: Float64Array | number[];
}

export interface geometry_msgs_PoseWithCovarianceStamped {
  header: std_msgs_Header;
  pose: geometry_msgs_PoseWithCovariance;
}

export interface geometry_msgs_Quaternion {
  x: number;
  y: number;
  z: number;
  w: number;
}

export interface geometry_msgs_QuaternionStamped {
  header: std_msgs_Header;
  quaternion: geometry_msgs_Quaternion;
}

export interface geometry_msgs_Transform {
  translation: geometry_msgs_Vector3;
  rotation: geometry_msgs_Quaternion;
}

export interface geometry_msgs_TransformStamped {
  header: std_msgs_Header;
  child_frame_id: string;
  transform: geometry_msgs_Transform;
}

export interface geometry_msgs_Twist {
  linear: geometry_msgs_Vector3;
  angular: geometry_msgs_Vector3;
}

export interface geometry_msgs_TwistStamped {
  header: std_msgs_Header;
  twist: geometry_msgs_Twist;
}

export interface geometry_msgs_TwistWithCovariance {
  twist: geometry_msgs_Twist;
  covariance: Float64Array | number[];
}

export interface geometry_msgs_TwistWithCovarianceStamped {
  header: std_msgs_Header;
  twist: geometry_msgs_TwistWithCovariance;
}

export interface geometry_msgs_Vector3 {
  x: number;
  y: number;
  z: number;
}

export interface geometry_msgs_Vector3Stamped {
  header: std_msgs_Header;
  vector: geometry_msgs_Vector3;
}

export interface geometry_msgs_VelocityStamped {
  header: std_msgs_Header;
  body_frame_id: string;
  reference_frame_id: string;
  velocity: geometry_msgs_Twist;
}

export interface geometry_msgs_Wrench {
  force: geometry_msgs_Vector3;
  torque: geometry_msgs_Vector3;
}

export interface geometry_msgs_WrenchStamped {
  header: std_msgs_Header;
  wrench: geometry_msgs_Wrench;
}

export interface mavros_msgs_AttitudeTarget {
  header: std_msgs_Header;
  type_mask: number;
  orientation: geometry_msgs_Quaternion;
  body_rate: geometry_msgs_Vector3;
  thrust: number;
}

export const mavros_msgs_AttitudeTarget_ = {
  IGNORE_ROLL_RATE: 1,
  IGNORE_PITCH_RATE: 2,
  IGNORE_YAW_RATE: 4,
  IGNORE_THRUST: 64,
  IGNORE_ATTITUDE: 128,
} as const;

export interface mavros_msgs_ExtendedState {
  header: std_msgs_Header;
  vtol_state: number;
  landed_state: number;
}

export const mavros_msgs_ExtendedState_ = {
  VTOL_STATE_UNDEFINED: 0,
  VTOL_STATE_TRANSITION_TO_FW: 1,
  VTOL_STATE_TRANSITION_TO_MC: 2,
  VTOL_STATE_MC: 3,
  VTOL_STATE_FW: 4,
  LANDED_STATE_UNDEFINED: 0,
  LANDED_STATE_ON_GROUND: 1,
  LANDED_STATE_IN_AIR: 2,
  LANDED_STATE_TAKEOFF: 3,
  LANDED_STATE_LANDING: 4,
} as const;

export interface mavros_msgs_ParamValue {
  integer: number | bigint;
  real: number;
}

export interface mavros_msgs_PositionTarget {
  header: std_msgs_Header;
  coordinate_frame: number;
  type_mask: number;
  position: geometry_msgs_Point;
  velocity: geometry_msgs_Vector3;
  acceleration_or_force: geometry_msgs_Vector3;
  yaw: number;
  yaw_rate: number;
}

export const mavros_msgs_PositionTarget_ = {
  FRAME_LOCAL_NED: 1,
  FRAME_LOCAL_OFFSET_NED: 7,
  FRAME_BODY_NED: 8,
  FRAME_BODY_OFFSET_NED: 9,
  IGNORE_PX: 1,
  IGNORE_PY: 2,
  IGNORE_PZ: 4,
  IGNORE_VX: 8,
  IGNORE_VY: 16,
  IGNORE_VZ: 32,
  IGNORE_AFX: 64,
  IGNORE_AFY: 128,
  IGNORE_AFZ: 256,
  FORCE: 512,
  IGNORE_YAW: 1024,
  IGNORE_YAW_RATE: 2048,
} as const;

export interface mavros_msgs_State {
  header: std_msgs_Header;
  connected: boolean;
  armed: boolean;
  guided: boolean;
  manual_input: boolean;
  mode: string;
  system_status: number;
}

export const mavros_msgs_State_ = {
  MODE_APM_PLANE_MANUAL: "MANUAL",
  MODE_APM_PLANE_CIRCLE: "CIRCLE",
  MODE_APM_PLANE_STABILIZE: "STABILIZE",
  MODE_APM_PLANE_TRAINING: "TRAINING",
  MODE_APM_PLANE_ACRO: "ACRO",
  MODE_APM_PLANE_FBWA: "FBWA",
  MODE_APM_PLANE_FBWB: "FBWB",
  MODE_APM_PLANE_CRUISE: "CRUISE",
  MODE_APM_PLANE_AUTOTUNE: "AUTOTUNE",
  MODE_APM_PLANE_AUTO: "AUTO",
  MODE_APM_PLANE_RTL: "RTL",
  MODE_APM_PLANE_LOITER: "LOITER",
  MODE_APM_PLANE_LAND: "LAND",
  MODE_APM_PLANE_GUIDED: "GUIDED",
  MODE_APM_PLANE_INITIALISING: "INITIALISING",
  MODE_APM_PLANE_QSTABILIZE: "QSTABILIZE",
  MODE_APM_PLANE_QHOVER: "QHOVER",
  MODE_APM_PLANE_QLOITER: "QLOITER",
  MODE_APM_PLANE_QLAND: "QLAND",
  MODE_APM_PLANE_QRTL: "QRTL",
  MODE_APM_COPTER_STABILIZE: "STABILIZE",
  MODE_APM_COPTER_ACRO: "ACRO",
  MODE_APM_COPTER_ALT_HOLD: "ALT_HOLD",
  MODE_APM_COPTER_AUTO: "AUTO",
  MODE_APM_COPTER_GUIDED: "GUIDED",
  MODE_APM_COPTER_LOITER: "LOITER",
  MODE_APM_COPTER_RTL: "RTL",
  MODE_APM_COPTER_CIRCLE: "CIRCLE",
  MODE_APM_COPTER_POSITION: "POSITION",
  MODE_APM_COPTER_LAND: "LAND",
  MODE_APM_COPTER_OF_LOITER: "OF_LOITER",
  MODE_APM_COPTER_DRIFT: "DRIFT",
  MODE_APM_COPTER_SPORT: "SPORT",
  MODE_APM_COPTER_FLIP: "FLIP",
  MODE_APM_COPTER_AUTOTUNE: "AUTOTUNE",
  MODE_APM_COPTER_POSHOLD: "POSHOLD",
  MODE_APM_COPTER_BRAKE: "BRAKE",
  MODE_APM_COPTER_THROW: "THROW",
  MODE_APM_COPTER_AVOID_ADSB: "AVOID_ADSB",
  MODE_APM_COPTER_GUIDED_NOGPS: "GUIDED_NOGPS",
  MODE_APM_ROVER_MANUAL: "MANUAL",
  MODE_APM_ROVER_LEARNING: "LEARNING",
  MODE_APM_ROVER_STEERING: "STEERING",
  MODE_APM_ROVER_HOLD: "HOLD",
  MODE_APM_ROVER_AUTO: "AUTO",
  MODE_APM_ROVER_RTL: "RTL",
  MODE_APM_ROVER_GUIDED: "GUIDED",
  MODE_APM_ROVER_INITIALISING: "INITIALISING",
  MODE_PX4_MANUAL: "MANUAL",
  MODE_PX4_ACRO: "ACRO",
  MODE_PX4_ALTITUDE: "ALTCTL",
  MODE_PX4_POSITION: "POSCTL",
  MODE_PX4_OFFBOARD: "OFFBOARD",
  MODE_PX4_STABILIZED: "STABILIZED",
  MODE_PX4_RATTITUDE: "RATTITUDE",
  MODE_PX4_MISSION: "AUTO.MISSION",
  MODE_PX4_LOITER: "AUTO.LOITER",
  MODE_PX4_RTL: "AUTO.RTL",
  MODE_PX4_LAND: "AUTO.LAND",
  MODE_PX4_RTGS: "AUTO.RTGS",
  MODE_PX4_READY: "AUTO.READY",
  MODE_PX4_TAKEOFF: "AUTO.TAKEOFF",
} as const;

export interface mavros_msgs_Waypoint {
  frame: number;
  command: number;
  is_current: boolean;
  autocontinue: boolean;
  param1: number;
  param2: number;
  param3: number;
  param4: number;
  x_lat: number;
  y_long: number;
  z_alt: number;
}

export const mavros_msgs_Waypoint_ = {
  FRAME_GLOBAL: 0,
  FRAME_LOCAL_NED: 1,
  FRAME_MISSION: 2,
  FRAME_GLOBAL_REL_ALT: 3,
  FRAME_LOCAL_ENU: 4,
  FRAME_GLOBAL_INT: 5,
  FRAME_GLOBAL_RELATIVE_ALT_INT: 6,
  FRAME_LOCAL_OFFSET_NED: 7,
  FRAME_BODY_NED: 8,
  FRAME_BODY_OFFSET_NED: 9,
  FRAME_GLOBAL_TERRAIN_ALT: 10,
  FRAME_GLOBAL_TERRAIN_ALT_INT: 11,
  FRAME_BODY_FRD: 12,
  FRAME_RESERVED_13: 13,
  FRAME_RESERVED_14: 14,
  FRAME_RESERVED_15: 15,
  FRAME_RESERVED_16: 16,
  FRAME_RESERVED_17: 17,
  FRAME_RESERVED_18: 18,
  FRAME_RESERVED_19: 19,
  FRAME_LOCAL_FRD: 20,
  FRAME_LOCAL_FLU: 21,
} as const;

export interface mavros_msgs_WaypointList {
  current_seq: number;
  waypoints: mavros_msgs_Waypoint[];
}

export interface mavros_msgs_CommandBool_Request {
  value: boolean;
}

export interface mavros_msgs_CommandBool_Response {
  success: boolean;
  result: number;
}

export interface mavros_msgs_CommandHome_Request {
  current_gps: boolean;
  yaw: number;
  latitude: number;
  longitude: number;
  altitude: number;
}

export interface mavros_msgs_CommandHome_Response {
  success: boolean;
  result: number;
}

export interface mavros_msgs_CommandLong_Request {
  broadcast: boolean;
  command: number;
  confirmation: number;
  param1: number;
  param2: number;
  param3: number;
  param4: number;
  param5: number;
  param6: number;
  param7: number;
}

export interface mavros_msgs_CommandLong_Response {
  success: boolean;
  result: number;
}

export interface mavros_msgs_CommandTOL_Request {
  min_pitch: number;
  yaw: number;
  latitude: number;
  longitude: number;
  altitude: number;
}

export interface mavros_msgs_CommandTOL_Response {
  success: boolean;
  result: number;
}

export interface mavros_msgs_ParamGet_Request {
  param_id: string;
}

export interface mavros_msgs_ParamGet_Response {
  success: boolean;
  value: mavros_msgs_ParamValue;
}

export interface mavros_msgs_SetMode_Request {
  base_mode: number;
  custom_mode: string;
}

export const mavros_msgs_SetMode_Request_ = {
  MAV_MODE_PREFLIGHT: 0,
  MAV_MODE_STABILIZE_DISARMED: 80,
  MAV_MODE_STABILIZE_ARMED: 208,
  MAV_MODE_MANUAL_DISARMED: 64,
  MAV_MODE_MANUAL_ARMED: 192,
  MAV_MODE_GUIDED_DISARMED: 88,
  MAV_MODE_GUIDED_ARMED: 216,
  MAV_MODE_AUTO_DISARMED: 92,
  MAV_MODE_AUTO_ARMED: 220,
  MAV_MODE_TEST_DISARMED: 66,
  MAV_MODE_TEST_ARMED: 194,
} as const;

export interface mavros_msgs_SetMode_Response {
  mode_sent: boolean;
}

export interface mavros_msgs_StreamRate_Request {
  stream_id: number;
  message_rate: number;
  on_off: boolean;
}

export const mavros_msgs_StreamRate_Request_ = {
  STREAM_ALL: 0,
  STREAM_RAW_SENSORS: 1,
  STREAM_EXTENDED_STATUS: 2,
  STREAM_RC_CHANNELS: 3,
  STREAM_RAW_CONTROLLER: 4,
  STREAM_POSITION: 6,
  STREAM_EXTRA1: 10,
  STREAM_EXTRA2: 11,
  STREAM_EXTRA3: 12,
} as const;

export type mavros_msgs_StreamRate_Response = Record<string, never>;

export type mavros_msgs_WaypointClear_Request = Record<string, never>;

export interface mavros_msgs_WaypointClear_Response {
  success: boolean;
}

export type mavros_msgs_WaypointPull_Request = Record<string, never>;

export interface mavros_msgs_WaypointPull_Response {
  success: boolean;
  wp_received: number;
}

export interface mavros_msgs_WaypointPush_Request {
  start_index: number;
  waypoints: mavros_msgs_Waypoint[];
}

export interface mavros_msgs_WaypointPush_Response {
  success: boolean;
  wp_transfered: number;
}

export interface mavros_msgs_WaypointSetCurrent_Request {
  wp_seq: number;
}

export interface mavros_msgs_WaypointSetCurrent_Response {
  success: boolean;
}

export interface nav_msgs_GridCells {
  header: std_msgs_Header;
  cell_width: number;
  cell_height: number;
  cells: geometry_msgs_Point[];
}

export interface nav_msgs_MapMetaData {
  map_load_time: builtin_interfaces_Time;
  resolution: number;
  width: number;
  height: number;
  origin: geometry_msgs_Pose;
}

export interface nav_msgs_OccupancyGrid {
  header: std_msgs_Header;
  info: nav_msgs_MapMetaData;
  data: Int8Array | number[];
}

export interface nav_msgs_Odometry {
  header: std_msgs_Header;
  child_frame_id: string;
  pose: geometry_msgs_PoseWithCovariance;
  twist: geometry_msgs_TwistWithCovariance;
}

export interface nav_msgs_Path {
  header: std_msgs_Header;
  poses: geometry_msgs_PoseStamped[];
}

export interface octomap_msgs_Octomap {
  header: std_msgs_Header;
  binary: boolean;
  id: string;
  resolution: number;
  data: Int8Array | number[];
}

export interface octomap_msgs_OctomapWithPose {
  header: std_msgs_Header;
  origin: geometry_msgs_Pose;
  octomap: octomap_msgs_Octomap;
}

export interface octomap_msgs_BoundingBoxQuery_Request {
  min: geometry_msgs_Point;
  max: geometry_msgs_Point;
}

export type octomap_msgs_BoundingBoxQuery_Response = Record<string, never>;

export type octomap_msgs_GetOctomap_Request = Record<string, never>;

export interface octomap_msgs_GetOctomap_Response {
  map: octomap_msgs_Octomap;
}

export interface rosapi_msgs_TypeDef {
  type: string;
  fieldnames: string[];
  fieldtypes: string[];
  fieldarraylen: Int32Array | number[];
  examples: string[];
  constnames: string[];
  constvalues: string[];
}

export interface rosapi_msgs_ActionType_Request {
  action: string;
}

export interface rosapi_msgs_ActionType_Response {
  type: string;
}

export interface rosapi_msgs_DeleteParam_Request {
  name: string;
}

export interface rosapi_msgs_DeleteParam_Response {
  successful: boolean;
  reason: string;
}

export type rosapi_msgs_GetActionServers_Request = Record<string, never>;

export interface rosapi_msgs_GetActionServers_Response {
  action_servers: string[];
}

export type rosapi_msgs_GetParamNames_Request = Record<string, never>;

export interface rosapi_msgs_GetParamNames_Response {
  names: string[];
}

export interface rosapi_msgs_GetParam_Request {
  name: string;
  default_value: string;
}

export interface rosapi_msgs_GetParam_Response {
  value: string;
  successful: boolean;
  reason: string;
}

export type rosapi_msgs_GetROSVersion_Request = Record<string, never>;

export interface rosapi_msgs_GetROSVersion_Response {
  version: number;
  distro: string;
}

export type rosapi_msgs_GetTime_Request = Record<string, never>;

export interface rosapi_msgs_GetTime_Response {
  time: builtin_interfaces_Time;
}

export interface rosapi_msgs_HasParam_Request {
  name: string;
}

export interface rosapi_msgs_HasParam_Response {
  exists: boolean;
}

export type rosapi_msgs_Interfaces_Request = Record<string, never>;

export interface rosapi_msgs_Interfaces_Response {
  interfaces: string[];
}

export interface rosapi_msgs_MessageDetails_Request {
  type: string;
}

export interface rosapi_msgs_MessageDetails_Response {
  typedefs: rosapi_msgs_TypeDef[];
}

export interface rosapi_msgs_NodeDetails_Request {
  node: string;
}

export interface rosapi_msgs_NodeDetails_Response {
  subscribing: string[];
  publishing: string[];
  services: string[];
}

export type rosapi_msgs_Nodes_Request = Record<string, never>;

export interface rosapi_msgs_Nodes_Response {
  nodes: string[];
}

export interface rosapi_msgs_Publishers_Request {
  topic: string;
}

export interface rosapi_msgs_Publishers_Response {
  publishers: string[];
}

export interface rosapi_msgs_SearchParam_Request {
  name: string;
}

export interface rosapi_msgs_SearchParam_Response {
  global_name: string;
}

export interface rosapi_msgs_ServiceHost_Request {
  service: string;
}

export interface rosapi_msgs_ServiceHost_Response {
  host: string;
}

export interface rosapi_msgs_ServiceNode_Request {
  service: string;
}

export interface rosapi_msgs_ServiceNode_Response {
  node: string;
}

export interface rosapi_msgs_ServiceProviders_Request {
  service: string;
}

export interface rosapi_msgs_ServiceProviders_Response {
  providers: string[];
}

export interface rosapi_msgs_ServiceRequestDetails_Request {
  type: string;
}

export interface rosapi_msgs_ServiceRequestDetails_Response {
  typedefs: rosapi_msgs_TypeDef[];
}

export interface rosapi_msgs_ServiceResponseDetails_Request {
  type: string;
}

export interface rosapi_msgs_ServiceResponseDetails_Response {
  typedefs: rosapi_msgs_TypeDef[];
}

export interface rosapi_msgs_ServiceType_Request {
  service: string;
}

export interface rosapi_msgs_ServiceType_Response {
  type: string;
}

export interface rosapi_msgs_ServicesForType_Request {
  type: string;
}

export interface rosapi_msgs_ServicesForType_Response {
  services: string[];
}

export type rosapi_msgs_Services_Request = Record<string, never>;

export interface rosapi_msgs_Services_Response {
  services: string[];
}

export interface rosapi_msgs_SetParam_Request {
  name: string;
  value: string;
}

export interface rosapi_msgs_SetParam_Response {
  successful: boolean;
  reason: string;
}

export interface rosapi_msgs_Subscribers_Request {
  topic: string;
}

export interface rosapi_msgs_Subscribers_Response {
  subscribers: string[];
}

export interface rosapi_msgs_TopicType_Request {
  topic: string;
}

export interface rosapi_msgs_TopicType_Response {
  type: string;
}

export type rosapi_msgs_TopicsAndRawTypes_Request = Record<string, never>;

export interface rosapi_msgs_TopicsAndRawTypes_Response {
  topics: string[];
  types: string[];
  typedefs_full_text: string[];
}

export interface rosapi_msgs_TopicsForType_Request {
  type: string;
}

export interface rosapi_msgs_TopicsForType_Response {
  topics: string[];
}

export type rosapi_msgs_Topics_Request = Record<string, never>;

export interface rosapi_msgs_Topics_Response {
  topics: string[];
  types: string[];
}

export interface rosgraph_msgs_Clock {
  clock: builtin_interfaces_Time;
}

export interface sensor_msgs_BatteryState {
  header: std_msgs_Header;
  voltage: number;
  temperature: number;
  current: number;
  charge: number;
  capacity: number;
  design_capacity: number;
  percentage: number;
  power_supply_status: number;
  power_supply_health: number;
  power_supply_technology: number;
  present: boolean;
  cell_voltage: Float32Array | number[];
  cell_temperature: Float32Array | number[];
  location: string;
  serial_number: string;
}

export const sensor_msgs_BatteryState_ = {
  POWER_SUPPLY_STATUS_UNKNOWN: 0,
  POWER_SUPPLY_STATUS_CHARGING: 1,
  POWER_SUPPLY_STATUS_DISCHARGING: 2,
  POWER_SUPPLY_STATUS_NOT_CHARGING: 3,
  POWER_SUPPLY_STATUS_FULL: 4,
  POWER_SUPPLY_HEALTH_UNKNOWN: 0,
  POWER_SUPPLY_HEALTH_GOOD: 1,
  POWER_SUPPLY_HEALTH_OVERHEAT: 2,
  POWER_SUPPLY_HEALTH_DEAD: 3,
  POWER_SUPPLY_HEALTH_OVERVOLTAGE: 4,
  POWER_SUPPLY_HEALTH_UNSPEC_FAILURE: 5,
  POWER_SUPPLY_HEALTH_COLD: 6,
  POWER_SUPPLY_HEALTH_WATCHDOG_TIMER_EXPIRE: 7,
  POWER_SUPPLY_HEALTH_SAFETY_TIMER_EXPIRE: 8,
  POWER_SUPPLY_TECHNOLOGY_UNKNOWN: 0,
  POWER_SUPPLY_TECHNOLOGY_NIMH: 1,
  POWER_SUPPLY_TECHNOLOGY_LION: 2,
  POWER_SUPPLY_TECHNOLOGY_LIPO: 3,
  POWER_SUPPLY_TECHNOLOGY_LIFE: 4,
  POWER_SUPPLY_TECHNOLOGY_NICD: 5,
  POWER_SUPPLY_TECHNOLOGY_LIMN: 6,
  POWER_SUPPLY_TECHNOLOGY_TERNARY: 7,
  POWER_SUPPLY_TECHNOLOGY_VRLA: 8,
} as const;

export interface sensor_msgs_CameraInfo {
  header: std_msgs_Header;
  height: number;
  width: number;
  distortion_model: string;
  d: Float64Array | number[];
  k: Float64Array | number[];
  r: Float64Array | number[];
  p: Float64Array | number[];
  binning_x: number;
  binning_y: number;
  roi: sensor_msgs_RegionOfInterest;
}

export interface sensor_msgs_ChannelFloat32 {
  name: string;
  values: Float32Array | number[];
}

export interface sensor_msgs_CompressedImage {
  header: std_msgs_Header;
  format: string;
  data: Uint8Array | string;
}

export interface sensor_msgs_FluidPressure {
  header: std_msgs_Header;
  fluid_pressure: number;
  variance: number;
}

export interface sensor_msgs_Illuminance {
  header: std_msgs_Header;
  illuminance: number;
  variance: number;
}

export interface sensor_msgs_Image {
  header: std_msgs_Header;
  height: number;
  width: number;
  encoding: string;
  is_bigendian: number;
  step: number;
  data: Uint8Array | string;
}

export interface sensor_msgs_Imu {
  header: std_msgs_Header;
  orientation: geometry_msgs_Quaternion;
  orientation_covariance: Float64Array | number[];
  angular_velocity: geometry_msgs_Vector3;
  angular_velocity_covariance: Float64Array | number[];
  linear_acceleration: geometry_msgs_Vector3;
  linear_acceleration_covariance: Float64Array | number[];
}

export interface sensor_msgs_JointState {
  header: std_msgs_Header;
  name: string[];
  position: Float64Array | number[];
  velocity: Float64Array | number[];
  effort: Float64Array | number[];
}

export interface sensor_msgs_Joy {
  header: std_msgs_Header;
  axes: Float32Array | number[];
  buttons: Int32Array | number[];
}

export interface sensor_msgs_JoyFeedback {
  type: number;
  id: number;
  intensity: number;
}

export const sensor_msgs_JoyFeedback_ = {
  TYPE_LED: 0,
  TYPE_RUMBLE: 1,
  TYPE_BUZZER: 2,
} as const;

export interface sensor_msgs_JoyFeedbackArray {
  array: sensor_msgs_JoyFeedback[];
}

export interface sensor_msgs_LaserEcho {
  echoes: Float32Array | number[];
}

export interface sensor_msgs_LaserScan {
  header: std_msgs_Header;
  angle_min: number;
  angle_max: number;
  angle_increment: number;
  time_increment: number;
  scan_time: number;
  range_min: number;
  range_max: number;
  ranges: Float32Array | number[];
  intensities: Float32Array | number[];
}

export interface sensor_msgs_MagneticField {
  header: std_msgs_Header;
  magnetic_field: geometry_msgs_Vector3;
  magnetic_field_covariance: Float64Array | number[];
}

export interface sensor_msgs_MultiDOFJointState {
  header: std_msgs_Header;
  joint_names: string[];
  transforms: geometry_msgs_Transform[];
  twist: geometry_msgs_Twist[];
  wrench: geometry_msgs_Wrench[];
}

export interface sensor_msgs_MultiEchoLaserScan {
  header: std_msgs_Header;
  angle_min: number;
  angle_max: number;
  angle_increment: number;
  time_increment: number;
  scan_time: number;
  range_min: number;
  range_max: number;
  ranges: sensor_msgs_LaserEcho[];
  intensities: sensor_msgs_LaserEcho[];
}

export interface sensor_msgs_NavSatFix {
  header: std_msgs_Header;
  status: sensor_msgs_NavSatStatus;
  latitude: number;
  longitude: number;
  altitude: number;
  position_covariance: Float64Array | number[];
  position_covariance_type: number;
}

export const sensor_msgs_NavSatFix_ = {
  COVARIANCE_TYPE_UNKNOWN: 0,
  COVARIANCE_TYPE_APPROXIMATED: 1,
  COVARIANCE_TYPE_DIAGONAL_KNOWN: 2,
  COVARIANCE_TYPE_KNOWN: 3,
} as const;

export interface sensor_msgs_NavSatStatus {
  status: number;
  service: number;
}

export const sensor_msgs_NavSatStatus_ = {
  STATUS_UNKNOWN: -2,
  STATUS_NO_FIX: -1,
  STATUS_FIX: 0,
  STATUS_SBAS_FIX: 1,
  STATUS_GBAS_FIX: 2,
  SERVICE_UNKNOWN: 0,
  SERVICE_GPS: 1,
  SERVICE_GLONASS: 2,
  SERVICE_COMPASS: 4,
  SERVICE_GALILEO: 8,
} as const;

export interface sensor_msgs_PointCloud {
  header: std_msgs_Header;
  points: geometry_msgs_Point32[];
  channels: sensor_msgs_ChannelFloat32[];
}

export interface sensor_msgs_PointCloud2 {
  header: std_msgs_Header;
  height: number;
  width: number;
  fields: sensor_msgs_PointField[];
  is_bigendian: boolean;
  point_step: number;
  row_step: number;
  data: Uint8Array | string;
  is_dense: boolean;
}

export interface sensor_msgs_PointField {
  name: string;
  offset: number;
  datatype: number;
  count: number;
}

export const sensor_msgs_PointField_ = {
  INT8: 1,
  UINT8: 2,
  INT16: 3,
  UINT16: 4,
  INT32: 5,
  UINT32: 6,
  FLOAT32: 7,
  FLOAT64: 8,
} as const;

export interface sensor_msgs_Range {
  header: std_msgs_Header;
  radiation_type: number;
  field_of_view: number;
  min_range: number;
  max_range: number;
  range: number;
  variance: number;
}

export const sensor_msgs_Range_ = {
  ULTRASOUND: 0,
  INFRARED: 1,
} as const;

export interface sensor_msgs_RegionOfInterest {
  x_offset: number;
  y_offset: number;
  height: number;
  width: number;
  do_rectify: boolean;
}

export interface sensor_msgs_RelativeHumidity {
  header: std_msgs_Header;
  relative_humidity: number;
  variance: number;
}

export interface sensor_msgs_Temperature {
  header: std_msgs_Header;
  temperature: number;
  variance: number;
}

export interface sensor_msgs_TimeReference {
  header: std_msgs_Header;
  time_ref: builtin_interfaces_Time;
  source: string;
}

export interface simulation_interfaces_SimulateSteps_Feedback {
  completed_steps: number | bigint;
  remaining_steps: number | bigint;
}

export interface simulation_interfaces_SimulateSteps_FeedbackMessage {
  goal_id: unique_identifier_msgs_UUID;
  feedback: simulation_interfaces_SimulateSteps_Feedback;
}

export interface simulation_interfaces_SimulateSteps_GetResult_Request {
  goal_id: unique_identifier_msgs_UUID;
}

export interface simulation_interfaces_SimulateSteps_GetResult_Response {
  status: number;
  result: simulation_interfaces_SimulateSteps_Result;
}

export interface simulation_interfaces_SimulateSteps_Goal {
  steps: number | bigint;
}

export interface simulation_interfaces_SimulateSteps_Result {
  result: simulation_interfaces_Result;
}

export interface simulation_interfaces_SimulateSteps_SendGoal_Request {
  goal_id: unique_identifier_msgs_UUID;
  goal: simulation_interfaces_SimulateSteps_Goal;
}

export interface simulation_interfaces_SimulateSteps_SendGoal_Response {
  accepted: boolean;
  stamp: builtin_interfaces_Time;
}

export interface simulation_interfaces_Bounds {
  type: number;
  points: geometry_msgs_Vector3[];
}

export const simulation_interfaces_Bounds_ = {
  TYPE_EMPTY: 0,
  TYPE_BOX: 1,
  TYPE_CONVEX_HULL: 2,
  TYPE_SPHERE: 3,
} as const;

export interface simulation_interfaces_EntityCategory {
  category: number;
}

export const simulation_interfaces_EntityCategory_ = {
  CATEGORY_OBJECT: 0,
  CATEGORY_ROBOT: 1,
  CATEGORY_HUMAN: 2,
  CATEGORY_DYNAMIC_OBJECT: 4,
  CATEGORY_STATIC_OBJECT: 5,
} as const;

export interface simulation_interfaces_EntityFilters {
  filter: string;
  categories: simulation_interfaces_EntityCategory[];
  tags: simulation_interfaces_TagsFilter;
  bounds: simulation_interfaces_Bounds;
}

export interface simulation_interfaces_EntityInfo {
  category: simulation_interfaces_EntityCategory;
  description: string;
  tags: string[];
}

export interface simulation_interfaces_EntityState {
  header: std_msgs_Header;
  pose: geometry_msgs_Pose;
  twist: geometry_msgs_Twist;
  acceleration: geometry_msgs_Accel;
}

export interface simulation_interfaces_NamedPose {
  name: string;
  description: string;
  tags: string[];
  pose: geometry_msgs_Pose;
}

export interface simulation_interfaces_Resource {
  uri: string;
  resource_string: string;
}

export interface simulation_interfaces_Result {
  result: number;
  error_message: string;
}

export const simulation_interfaces_Result_ = {
  RESULT_FEATURE_UNSUPPORTED: 0,
  RESULT_OK: 1,
  RESULT_NOT_FOUND: 2,
  RESULT_INCORRECT_STATE: 3,
  RESULT_OPERATION_FAILED: 4,
} as const;

export interface simulation_interfaces_SimulationState {
  state: number;
}

export const simulation_interfaces_SimulationState_ = {
  STATE_STOPPED: 0,
  STATE_PLAYING: 1,
  STATE_PAUSED: 2,
  STATE_QUITTING: 3,
  STATE_NO_WORLD: 4,
  STATE_LOADING_WORLD: 5,
} as const;

export interface simulation_interfaces_SimulatorFeatures {
  features: Uint16Array | number[];
  spawn_formats: string[];
  custom_info: string;
}

export const simulation_interfaces_SimulatorFeatures_ = {
  SPAWNING: 0,
  DELETING: 1,
  NAMED_POSES: 2,
  POSE_BOUNDS: 3,
  ENTITY_TAGS: 4,
  ENTITY_BOUNDS: 5,
  ENTITY_BOUNDS_BOX: 6,
  ENTITY_BOUNDS_CONVEX: 7,
  ENTITY_CATEGORIES: 8,
  SPAWNING_RESOURCE_STRING: 9,
  ENTITY_STATE_GETTING: 10,
  ENTITY_STATE_SETTING: 11,
  ENTITY_INFO_GETTING: 12,
  ENTITY_INFO_SETTING: 13,
  SPAWNABLES: 14,
  SIMULATION_RESET: 20,
  SIMULATION_RESET_TIME: 21,
  SIMULATION_RESET_STATE: 22,
  SIMULATION_RESET_SPAWNED: 23,
  SIMULATION_STATE_GETTING: 24,
  SIMULATION_STATE_SETTING: 25,
  SIMULATION_STATE_PAUSE: 26,
  STEP_SIMULATION_SINGLE: 31,
  STEP_SIMULATION_MULTIPLE: 32,
  STEP_SIMULATION_ACTION: 33,
  WORLD_LOADING: 40,
  WORLD_RESOURCE_STRING: 41,
  WORLD_TAGS: 42,
  WORLD_UNLOADING: 43,
  WORLD_INFO_GETTING: 44,
  AVAILABLE_WORLDS: 45,
  SPAWNING_ENTITIES: 50,
} as const;

export interface simulation_interfaces_SpawnEntity {
  name: string;
  allow_renaming: boolean;
  entity_resource: simulation_interfaces_Resource;
  entity_namespace: string;
  initial_pose: geometry_msgs_PoseStamped;
}

export interface simulation_interfaces_SpawnResult {
  result: simulation_interfaces_Result;
  entity_name: string;
}

export const simulation_interfaces_SpawnResult_ = {
  NAME_NOT_UNIQUE: 101,
  NAME_INVALID: 102,
  UNSUPPORTED_FORMAT: 103,
  NO_RESOURCE: 104,
  NAMESPACE_INVALID: 105,
  RESOURCE_PARSE_ERROR: 106,
  MISSING_ASSETS: 107,
  UNSUPPORTED_ASSETS: 108,
  INVALID_POSE: 109,
} as const;

export interface simulation_interfaces_Spawnable {
  entity_resource: simulation_interfaces_Resource;
  description: string;
  spawn_bounds: simulation_interfaces_Bounds;
}

export interface simulation_interfaces_TagsFilter {
  tags: string[];
  filter_mode: number;
}

export const simulation_interfaces_TagsFilter_ = {
  FILTER_MODE_ANY: 0,
  FILTER_MODE_ALL: 1,
} as const;

export interface simulation_interfaces_WorldResource {
  name: string;
  world_resource: simulation_interfaces_Resource;
  description: string;
  tags: string[];
}

export interface simulation_interfaces_DeleteEntity_Request {
  entity: string;
}

export interface simulation_interfaces_DeleteEntity_Response {
  result: simulation_interfaces_Result;
}

export interface simulation_interfaces_GetAvailableWorlds_Request {
  additional_sources: string[];
  filter: simulation_interfaces_TagsFilter;
  offline_only: boolean;
  continue_on_error: boolean;
}

export interface simulation_interfaces_GetAvailableWorlds_Response {
  result: simulation_interfaces_Result;
  worlds: simulation_interfaces_WorldResource[];
}

export const simulation_interfaces_GetAvailableWorlds_Response_ = {
  DEFAULT_SOURCES_FAILED: 101,
} as const;

export type simulation_interfaces_GetCurrentWorld_Request = Record<string, never>;

export interface simulation_interfaces_GetCurrentWorld_Response {
  result: simulation_interfaces_Result;
  world: simulation_interfaces_WorldResource;
}

export const simulation_interfaces_GetCurrentWorld_Response_ = {
  NO_WORLD_LOADED: 101,
} as const;

export interface simulation_interfaces_GetEntitiesStates_Request {
  filters: simulation_interfaces_EntityFilters;
}

export interface simulation_interfaces_GetEntitiesStates_Response {
  result: simulation_interfaces_Result;
  entities: string[];
  states: simulation_interfaces_EntityState[];
}

export interface simulation_interfaces_GetEntities_Request {
  filters: simulation_interfaces_EntityFilters;
}

export interface simulation_interfaces_GetEntities_Response {
  result: simulation_interfaces_Result;
  entities: string[];
}

export interface simulation_interfaces_GetEntityBounds_Request {
  entity: string;
}

export interface simulation_interfaces_GetEntityBounds_Response {
  result: simulation_interfaces_Result;
  bounds: simulation_interfaces_Bounds;
}

export interface simulation_interfaces_GetEntityInfo_Request {
  entity: string;
}

export interface simulation_interfaces_GetEntityInfo_Response {
  result: simulation_interfaces_Result;
  info: simulation_interfaces_EntityInfo;
}

export interface simulation_interfaces_GetEntityState_Request {
  entity: string;
}

export interface simulation_interfaces_GetEntityState_Response {
  result: simulation_interfaces_Result;
  state: simulation_interfaces_EntityState;
}

export interface simulation_interfaces_GetNamedPoseBounds_Request {
  name: string;
}

export interface simulation_interfaces_GetNamedPoseBounds_Response {
  result: simulation_interfaces_Result;
  bounds: simulation_interfaces_Bounds;
}

export interface simulation_interfaces_GetNamedPoses_Request {
  tags: simulation_interfaces_TagsFilter;
}

export interface simulation_interfaces_GetNamedPoses_Response {
  result: simulation_interfaces_Result;
  poses: simulation_interfaces_NamedPose[];
}

export type simulation_interfaces_GetSimulationState_Request = Record<string, never>;

export interface simulation_interfaces_GetSimulationState_Response {
  state: simulation_interfaces_SimulationState;
  result: simulation_interfaces_Result;
}

export type simulation_interfaces_GetSimulatorFeatures_Request = Record<string, never>;

export interface simulation_interfaces_GetSimulatorFeatures_Response {
  features: simulation_interfaces_SimulatorFeatures;
}

export interface simulation_interfaces_GetSpawnables_Request {
  sources: string[];
}

export interface simulation_interfaces_GetSpawnables_Response {
  result: simulation_interfaces_Result;
  spawnables: simulation_interfaces_Spawnable[];
}

export interface simulation_interfaces_LoadWorld_Request {
  world_resource: simulation_interfaces_Resource;
  fail_on_unsupported_element: boolean;
  ignore_missing_or_unsupported_assets: boolean;
}

export interface simulation_interfaces_LoadWorld_Response {
  result: simulation_interfaces_Result;
  world: simulation_interfaces_WorldResource;
}

export const simulation_interfaces_LoadWorld_Response_ = {
  UNSUPPORTED_FORMAT: 101,
  NO_RESOURCE: 102,
  RESOURCE_PARSE_ERROR: 103,
  MISSING_ASSETS: 104,
  UNSUPPORTED_ASSETS: 105,
  UNSUPPORTED_ELEMENTS: 106,
} as const;

export interface simulation_interfaces_ResetSimulation_Request {
  scope: number;
}

export const simulation_interfaces_ResetSimulation_Request_ = {
  SCOPE_DEFAULT: 0,
  SCOPE_TIME: 1,
  SCOPE_STATE: 2,
  SCOPE_SPAWNED: 4,
  SCOPE_ALL: 255,
} as const;

export interface simulation_interfaces_ResetSimulation_Response {
  result: simulation_interfaces_Result;
}

export interface simulation_interfaces_SetEntityInfo_Request {
  entity: string;
  info: simulation_interfaces_EntityInfo;
}

export interface simulation_interfaces_SetEntityInfo_Response {
  result: simulation_interfaces_Result;
}

export interface simulation_interfaces_SetEntityState_Request {
  entity: string;
  state: simulation_interfaces_EntityState;
  set_pose: boolean;
  set_twist: boolean;
  set_acceleration: boolean;
}

export interface simulation_interfaces_SetEntityState_Response {
  result: simulation_interfaces_Result;
}

export const simulation_interfaces_SetEntityState_Response_ = {
  INVALID_POSE: 101,
} as const;

export interface simulation_interfaces_SetSimulationState_Request {
  state: simulation_interfaces_SimulationState;
}

export interface simulation_interfaces_SetSimulationState_Response {
  result: simulation_interfaces_Result;
}

export const simulation_interfaces_SetSimulationState_Response_ = {
  ALREADY_IN_TARGET_STATE: 101,
  STATE_TRANSITION_ERROR: 102,
  INCORRECT_TRANSITION: 103,
} as const;

export interface simulation_interfaces_SpawnEntities_Request {
  spawn_requests: simulation_interfaces_SpawnEntity[];
}

export interface simulation_interfaces_SpawnEntities_Response {
  result: simulation_interfaces_Result;
  results: simulation_interfaces_SpawnResult[];
}

export const simulation_interfaces_SpawnEntities_Response_ = {
  ENTITIES_SPAWN_FAILED: 150,
} as const;

export interface simulation_interfaces_SpawnEntity_Request {
  name: string;
  allow_renaming: boolean;
  entity_resource: simulation_interfaces_Resource;
  entity_namespace: string;
  initial_pose: geometry_msgs_PoseStamped;
}

export interface simulation_interfaces_SpawnEntity_Response {
  result: simulation_interfaces_Result;
  entity_name: string;
}

export const simulation_interfaces_SpawnEntity_Response_ = {
  NAME_NOT_UNIQUE: 101,
  NAME_INVALID: 102,
  UNSUPPORTED_FORMAT: 103,
  NO_RESOURCE: 104,
  NAMESPACE_INVALID: 105,
  RESOURCE_PARSE_ERROR: 106,
  MISSING_ASSETS: 107,
  UNSUPPORTED_ASSETS: 108,
  INVALID_POSE: 109,
} as const;

export interface simulation_interfaces_StepSimulation_Request {
  steps: number | bigint;
}

export interface simulation_interfaces_StepSimulation_Response {
  result: simulation_interfaces_Result;
}

export type simulation_interfaces_UnloadWorld_Request = Record<string, never>;

export interface simulation_interfaces_UnloadWorld_Response {
  result: simulation_interfaces_Result;
}

export const simulation_interfaces_UnloadWorld_Response_ = {
  NO_WORLD_LOADED: 101,
} as const;

export interface std_msgs_Bool {
  data: boolean;
}

export interface std_msgs_Byte {
  data: number;
}

export interface std_msgs_ByteMultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Uint8Array | string;
}

export interface std_msgs_Char {
  data: number;
}

export interface std_msgs_ColorRGBA {
  r: number;
  g: number;
  b: number;
  a: number;
}

export type std_msgs_Empty = Record<string, never>;

export interface std_msgs_Float32 {
  data: number;
}

export interface std_msgs_Float32MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Float32Array | number[];
}

export interface std_msgs_Float64 {
  data: number;
}

export interface std_msgs_Float64MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Float64Array | number[];
}

export interface std_msgs_Header {
  stamp: builtin_interfaces_Time;
  frame_id: string;
}

export interface std_msgs_Int16 {
  data: number;
}

export interface std_msgs_Int16MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Int16Array | number[];
}

export interface std_msgs_Int32 {
  data: number;
}

export interface std_msgs_Int32MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Int32Array | number[];
}

export interface std_msgs_Int64 {
  data: number | bigint;
}

export interface std_msgs_Int64MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: (number | bigint)[];
}

export interface std_msgs_Int8 {
  data: number;
}

export interface std_msgs_Int8MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Int8Array | number[];
}

export interface std_msgs_MultiArrayDimension {
  label: string;
  size: number;
  stride: number;
}

export interface std_msgs_MultiArrayLayout {
  dim: std_msgs_MultiArrayDimension[];
  data_offset: number;
}

export interface std_msgs_String {
  data: string;
}

export interface std_msgs_UInt16 {
  data: number;
}

export interface std_msgs_UInt16MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Uint16Array | number[];
}

export interface std_msgs_UInt32 {
  data: number;
}

export interface std_msgs_UInt32MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Uint32Array | number[];
}

export interface std_msgs_UInt64 {
  data: number | bigint;
}

export interface std_msgs_UInt64MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: (number | bigint)[];
}

export interface std_msgs_UInt8 {
  data: number;
}

export interface std_msgs_UInt8MultiArray {
  layout: std_msgs_MultiArrayLayout;
  data: Uint8Array | string;
}

export type std_srvs_Empty_Request = Record<string, never>;

export type std_srvs_Empty_Response = Record<string, never>;

export interface std_srvs_SetBool_Request {
  data: boolean;
}

export interface std_srvs_SetBool_Response {
  success: boolean;
  message: string;
}

export type std_srvs_Trigger_Request = Record<string, never>;

export interface std_srvs_Trigger_Response {
  success: boolean;
  message: string;
}

export interface tf2_msgs_TF2Error {
  error: number;
  error_string: string;
}

export const tf2_msgs_TF2Error_ = {
  NO_ERROR: 0,
  LOOKUP_ERROR: 1,
  CONNECTIVITY_ERROR: 2,
  EXTRAPOLATION_ERROR: 3,
  INVALID_ARGUMENT_ERROR: 4,
  TIMEOUT_ERROR: 5,
  TRANSFORM_ERROR: 6,
} as const;

export interface tf2_msgs_TFMessage {
  transforms: geometry_msgs_TransformStamped[];
}

export type tf2_msgs_FrameGraph_Request = Record<string, never>;

export interface tf2_msgs_FrameGraph_Response {
  frame_yaml: string;
}

export interface trajectory_msgs_JointTrajectory {
  header: std_msgs_Header;
  joint_names: string[];
  points: trajectory_msgs_JointTrajectoryPoint[];
}

export interface trajectory_msgs_JointTrajectoryPoint {
  positions: Float64Array | number[];
  velocities: Float64Array | number[];
  accelerations: Float64Array | number[];
  effort: Float64Array | number[];
  time_from_start: builtin_interfaces_Duration;
}

export interface trajectory_msgs_MultiDOFJointTrajectory {
  header: std_msgs_Header;
  joint_names: string[];
  points: trajectory_msgs_MultiDOFJointTrajectoryPoint[];
}

export interface trajectory_msgs_MultiDOFJointTrajectoryPoint {
  transforms: geometry_msgs_Transform[];
  velocities: geometry_msgs_Twist[];
  accelerations: geometry_msgs_Twist[];
  time_from_start: builtin_interfaces_Duration;
}

export interface unique_identifier_msgs_UUID {
  uuid: Uint8Array | string;
}

export interface visualization_msgs_ImageMarker {
  header: std_msgs_Header;
  ns: string;
  id: number;
  type: number;
  action: number;
  position: geometry_msgs_Point;
  scale: number;
  outline_color: std_msgs_ColorRGBA;
  filled: number;
  fill_color: std_msgs_ColorRGBA;
  lifetime: builtin_interfaces_Duration;
  points: geometry_msgs_Point[];
  outline_colors: std_msgs_ColorRGBA[];
}

export const visualization_msgs_ImageMarker_ = {
  CIRCLE: 0,
  LINE_STRIP: 1,
  LINE_LIST: 2,
  POLYGON: 3,
  POINTS: 4,
  ADD: 0,
  REMOVE: 1,
} as const;

export interface visualization_msgs_InteractiveMarker {
  header: std_msgs_Header;
  pose: geometry_msgs_Pose;
  name: string;
  description: string;
  scale: number;
  menu_entries: visualization_msgs_MenuEntry[];
  controls: visualization_msgs_InteractiveMarkerControl[];
}

export interface visualization_msgs_InteractiveMarkerControl {
  name: string;
  orientation: geometry_msgs_Quaternion;
  orientation_mode: number;
  interaction_mode: number;
  always_visible: boolean;
  markers: visualization_msgs_Marker[];
  independent_marker_orientation: boolean;
  description: string;
}

export const visualization_msgs_InteractiveMarkerControl_ = {
  INHERIT: 0,
  FIXED: 1,
  VIEW_FACING: 2,
  NONE: 0,
  MENU: 1,
  BUTTON: 2,
  MOVE_AXIS: 3,
  MOVE_PLANE: 4,
  ROTATE_AXIS: 5,
  MOVE_ROTATE: 6,
  MOVE_3D: 7,
  ROTATE_3D: 8,
  MOVE_ROTATE_3D: 9,
} as const;

export interface visualization_msgs_InteractiveMarkerFeedback {
  header: std_msgs_Header;
  client_id: string;
  marker_name: string;
  control_name: string;
  event_type: number;
  pose: geometry_msgs_Pose;
  menu_entry_id: number;
  mouse_point: geometry_msgs_Point;
  mouse_point_valid: boolean;
}

export const visualization_msgs_InteractiveMarkerFeedback_ = {
  KEEP_ALIVE: 0,
  POSE_UPDATE: 1,
  MENU_SELECT: 2,
  BUTTON_CLICK: 3,
  MOUSE_DOWN: 4,
  MOUSE_UP: 5,
} as const;

export interface visualization_msgs_InteractiveMarkerInit {
  server_id: string;
  seq_num: number | bigint;
  markers: visualization_msgs_InteractiveMarker[];
}

export interface visualization_msgs_InteractiveMarkerPose {
  header: std_msgs_Header;
  pose: geometry_msgs_Pose;
  name: string;
}

export interface visualization_msgs_InteractiveMarkerUpdate {
  server_id: string;
  seq_num: number | bigint;
  type: number;
  markers: visualization_msgs_InteractiveMarker[];
  poses: visualization_msgs_InteractiveMarkerPose[];
  erases: string[];
}

export const visualization_msgs_InteractiveMarkerUpdate_ = {
  KEEP_ALIVE: 0,
  UPDATE: 1,
} as const;

export interface visualization_msgs_Marker {
  header: std_msgs_Header;
  ns: string;
  id: number;
  type: number;
  action: number;
  pose: geometry_msgs_Pose;
  scale: geometry_msgs_Vector3;
  color: std_msgs_ColorRGBA;
  lifetime: builtin_interfaces_Duration;
  frame_locked: boolean;
  points: geometry_msgs_Point[];
  colors: std_msgs_ColorRGBA[];
  texture_resource: string;
  texture: sensor_msgs_CompressedImage;
  uv_coordinates: visualization_msgs_UVCoordinate[];
  text: string;
  mesh_resource: string;
  mesh_file: visualization_msgs_MeshFile;
  mesh_use_embedded_materials: boolean;
}

export const visualization_msgs_Marker_ = {
  ARROW: 0,
  CUBE: 1,
  SPHERE: 2,
  CYLINDER: 3,
  LINE_STRIP: 4,
  LINE_LIST: 5,
  CUBE_LIST: 6,
  SPHERE_LIST: 7,
  POINTS: 8,
  TEXT_VIEW_FACING: 9,
  MESH_RESOURCE: 10,
  TRIANGLE_LIST: 11,
  ARROW_STRIP: 12,
  ADD: 0,
  MODIFY: 0,
  DELETE: 2,
  DELETEALL: 3,
} as const;

export interface visualization_msgs_MarkerArray {
  markers: visualization_msgs_Marker[];
}

export interface visualization_msgs_MenuEntry {
  id: number;
  parent_id: number;
  title: string;
  command: string;
  command_type: number;
}

export const visualization_msgs_MenuEntry_ = {
  FEEDBACK: 0,
  ROSRUN: 1,
  ROSLAUNCH: 2,
} as const;

export interface visualization_msgs_MeshFile {
  filename: string;
  data: Uint8Array | string;
}

export interface visualization_msgs_UVCoordinate {
  u: number;
  v: number;
}

export interface volery_interfaces_CommandRecord {
  stamp: builtin_interfaces_Time;
  number: number | bigint;
  step: number | bigint;
  turn: number;
  client: string;
  kind: string;
  name: string;
  type: string;
  content: string;
  cdr: Uint8Array | string;
  follows: boolean;
  latched: boolean;
  request: number | bigint;
}

export interface volery_interfaces_FlightState {
  header: std_msgs_Header;
  mode: string;
  airborne: boolean;
  crashed: boolean;
  pose: geometry_msgs_Pose;
  velocity: geometry_msgs_Vector3;
  angular_velocity: geometry_msgs_Vector3;
  acceleration: geometry_msgs_Vector3;
  battery_charge: number;
  battery_voltage: number;
  battery_current: number;
  rotors: Float32Array | number[];
}

export interface volery_interfaces_Gust {
  amplitude: geometry_msgs_Vector3;
  start: number;
  rise: number;
  end: number;
  front: geometry_msgs_Vector3;
}

export interface volery_interfaces_MavlinkPackets {
  link: number;
  profile: number;
  closed: boolean;
  data: Uint8Array | string;
}

export interface volery_interfaces_MissionStatus {
  header: std_msgs_Header;
  phase: string;
  sector: number;
  searched: number;
  sectors: number;
  team: string[];
  targets: number;
  problem: string;
}

export interface volery_interfaces_PlayerState {
  position: number;
  start: number;
  end: number;
  state: number;
  speed: number;
  loop: boolean;
  can_close: boolean;
}

export interface volery_interfaces_SearchState {
  header: std_msgs_Header;
  phase: string;
  position: geometry_msgs_Point;
}

export interface volery_interfaces_SimulationStatus {
  stamp: builtin_interfaces_Time;
  wall: builtin_interfaces_Time;
  scenario: string;
  state: number;
  speed: number;
  real_time_factor: number;
  duration: number;
  recording: string;
  stages: string[];
  load: Float64Array | number[];
  memory: number;
  clients: number;
  dropped: number | bigint;
  replaying: boolean;
  ended: boolean;
}

export interface volery_interfaces_Target {
  header: std_msgs_Header;
  finder: string;
  number: number;
  position: geometry_msgs_Point;
  covariance: Float64Array | number[];
  sightings: number;
}

export interface volery_interfaces_Targets {
  header: std_msgs_Header;
  targets: volery_interfaces_Target[];
}

export interface volery_interfaces_TeamReport {
  header: std_msgs_Header;
  name: string;
  phase: string;
  position: geometry_msgs_Point;
  velocity: geometry_msgs_Vector3;
  battery: number;
  sectors: number;
  sector: number;
  since: builtin_interfaces_Time;
  searched: Uint8Array | string;
  given_up: Uint8Array | string;
  targets: volery_interfaces_Target[];
}

export interface volery_interfaces_VehicleState {
  name: string;
  airframe: string;
  type: string;
  mode: string;
  airborne: boolean;
  crashed: boolean;
  battery: number;
  voltage: number;
  position: geometry_msgs_Point;
  velocity: geometry_msgs_Vector3;
  rotor_speed: number;
  command_age: number;
  operator: string;
}

export interface volery_interfaces_VehicleStates {
  header: std_msgs_Header;
  vehicles: volery_interfaces_VehicleState[];
}

export interface volery_interfaces_Weather {
  header: std_msgs_Header;
  wind: geometry_msgs_Vector3;
  w20: number;
  profile: string;
  gusts: volery_interfaces_Gust[];
  rain: number;
  snow: number;
  fog_visibility: number;
  dust_visibility: number;
  hour_of_day: number;
  visibility: number;
  sun_elevation: number;
  sun_azimuth: number;
}

export interface volery_interfaces_ByName_Request {
  name: string;
}

export interface volery_interfaces_ByName_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_EndFault_Request {
  fault: string;
}

export interface volery_interfaces_EndFault_Response {
  success: boolean;
  message: string;
}

export type volery_interfaces_GetGridMap_Request = Record<string, never>;

export interface volery_interfaces_GetGridMap_Response {
  name: string;
  names: string[];
  block_height: number;
  cell_size: number;
  rows: number;
  columns: number;
  success: boolean;
  message: string;
}

export type volery_interfaces_GetScenarioOptions_Request = Record<string, never>;

export interface volery_interfaces_GetScenarioOptions_Response {
  scenarios: string[];
  airframes: string[];
  sensor_sets: string[];
  sensor_set_descriptions: string[];
  changes_schema: string;
  success: boolean;
  message: string;
}

export type volery_interfaces_GetVehicleInfo_Request = Record<string, never>;

export interface volery_interfaces_GetVehicleInfo_Response {
  success: boolean;
  message: string;
  airframe: string;
  rotors: number;
  hover_thrust: number;
  speed: number;
  climb: number;
  descent: number;
  tilt: number;
  battery_cells: number;
  battery_capacity: number;
  latitude: number;
  longitude: number;
  altitude: number;
}

export type volery_interfaces_GetWeather_Request = Record<string, never>;

export interface volery_interfaces_GetWeather_Response {
  wind: geometry_msgs_Vector3;
  w20: number;
  profile: string;
  gusts: number;
  rain: number;
  snow: number;
  fog_visibility: number;
  dust_visibility: number;
  hour_of_day: number;
  visibility: number;
  sun_elevation: number;
  sun_azimuth: number;
  success: boolean;
  message: string;
}

export interface volery_interfaces_GoTo_Request {
  position: geometry_msgs_Point;
  yaw: number;
  keep_heading: boolean;
}

export interface volery_interfaces_GoTo_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_Gust_Request {
  amplitude: geometry_msgs_Vector3;
  rise: number;
  duration: number;
}

export interface volery_interfaces_Gust_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_HandOver_Request {
  uav: string;
  operator: string;
  to: string;
}

export interface volery_interfaces_HandOver_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_InjectFault_Request {
  fault: string;
}

export interface volery_interfaces_InjectFault_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_JoinLockStep_Request {
  name: string;
  period_s: number;
  timeout_s: number;
  stop_on_timeout: boolean;
  supports_reset: boolean;
  meets_at_start: boolean;
}

export interface volery_interfaces_JoinLockStep_Response {
  success: boolean;
  message: string;
  now: builtin_interfaces_Time;
}

export interface volery_interfaces_JoinSearch_Request {
  stamp: builtin_interfaces_Time;
  finder: string;
  place: geometry_msgs_Point;
}

export interface volery_interfaces_JoinSearch_Response {
  accepted: boolean;
  message: string;
}

export type volery_interfaces_ListSnapshots_Request = Record<string, never>;

export interface volery_interfaces_ListSnapshots_Response {
  success: boolean;
  message: string;
  names: string[];
  stamps: builtin_interfaces_Time[];
}

export interface volery_interfaces_LoadScenario_Request {
  scenario: string;
  changes: string;
}

export interface volery_interfaces_LoadScenario_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_PlayRecording_Request {
  name: string;
}

export interface volery_interfaces_PlayRecording_Response {
  success: boolean;
  message: string;
}

export type volery_interfaces_PlayerInfo_Request = Record<string, never>;

export interface volery_interfaces_PlayerInfo_Response {
  success: boolean;
  message: string;
  file: string;
  format: string;
  size: number | bigint;
  start: number;
  end: number;
  position: number;
  state: number;
  speed: number;
  loop: boolean;
  topics: string[];
  types: string[];
  counts: (number | bigint)[];
  refused: string[];
  reasons: string[];
  problem: string;
  scenario: string;
  seed: number | bigint;
}

export interface volery_interfaces_ReleaseControl_Request {
  uav: string;
  operator: string;
}

export interface volery_interfaces_ReleaseControl_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_Seek_Request {
  time: number;
}

export interface volery_interfaces_Seek_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_SetAttitudeTarget_Request {
  target: mavros_msgs_AttitudeTarget;
}

export interface volery_interfaces_SetAttitudeTarget_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_SetCommandTimeout_Request {
  seconds: number;
}

export interface volery_interfaces_SetCommandTimeout_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_SetGridMap_Request {
  name: string;
  block_height: number;
  cell_size: number;
}

export interface volery_interfaces_SetGridMap_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_SetLandingSpeed_Request {
  speed: number;
}

export interface volery_interfaces_SetLandingSpeed_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_SetPositionTarget_Request {
  target: mavros_msgs_PositionTarget;
}

export interface volery_interfaces_SetPositionTarget_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_SetSpeed_Request {
  factor: number;
}

export interface volery_interfaces_SetSpeed_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_SetWeather_Request {
  only: string[];
  wind: geometry_msgs_Vector3;
  w20: number;
  rain: number;
  snow: number;
  fog_visibility: number;
  dust_visibility: number;
  hour_of_day: number;
}

export interface volery_interfaces_SetWeather_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_StartRecording_Request {
  path: string;
  topics: string[];
  exclude: string[];
}

export interface volery_interfaces_StartRecording_Response {
  success: boolean;
  message: string;
  path: string;
}

export type volery_interfaces_StopRecording_Request = Record<string, never>;

export interface volery_interfaces_StopRecording_Response {
  success: boolean;
  message: string;
  path: string;
  messages: number | bigint;
}

export interface volery_interfaces_TakeControl_Request {
  uav: string;
  operator: string;
}

export interface volery_interfaces_TakeControl_Response {
  success: boolean;
  message: string;
}

export interface volery_interfaces_TakeOffTo_Request {
  altitude: number;
}

export interface volery_interfaces_TakeOffTo_Response {
  success: boolean;
  message: string;
}

export interface Messages {
  "builtin_interfaces/msg/Duration": builtin_interfaces_Duration;
  "builtin_interfaces/msg/Time": builtin_interfaces_Time;
  "diagnostic_msgs/msg/DiagnosticArray": diagnostic_msgs_DiagnosticArray;
  "diagnostic_msgs/msg/DiagnosticStatus": diagnostic_msgs_DiagnosticStatus;
  "diagnostic_msgs/msg/KeyValue": diagnostic_msgs_KeyValue;
  "geometry_msgs/msg/Accel": geometry_msgs_Accel;
  "geometry_msgs/msg/AccelStamped": geometry_msgs_AccelStamped;
  "geometry_msgs/msg/AccelWithCovariance": geometry_msgs_AccelWithCovariance;
  "geometry_msgs/msg/AccelWithCovarianceStamped": geometry_msgs_AccelWithCovarianceStamped;
  "geometry_msgs/msg/Inertia": geometry_msgs_Inertia;
  "geometry_msgs/msg/InertiaStamped": geometry_msgs_InertiaStamped;
  "geometry_msgs/msg/Point": geometry_msgs_Point;
  "geometry_msgs/msg/Point32": geometry_msgs_Point32;
  "geometry_msgs/msg/PointStamped": geometry_msgs_PointStamped;
  "geometry_msgs/msg/Polygon": geometry_msgs_Polygon;
  "geometry_msgs/msg/PolygonInstance": geometry_msgs_PolygonInstance;
  "geometry_msgs/msg/PolygonInstanceStamped": geometry_msgs_PolygonInstanceStamped;
  "geometry_msgs/msg/PolygonStamped": geometry_msgs_PolygonStamped;
  "geometry_msgs/msg/Pose": geometry_msgs_Pose;
  "geometry_msgs/msg/Pose2D": geometry_msgs_Pose2D;
  "geometry_msgs/msg/PoseArray": geometry_msgs_PoseArray;
  "geometry_msgs/msg/PoseStamped": geometry_msgs_PoseStamped;
  "geometry_msgs/msg/PoseWithCovariance": geometry_msgs_PoseWithCovariance;
  "geometry_msgs/msg/PoseWithCovarianceStamped": geometry_msgs_PoseWithCovarianceStamped;
  "geometry_msgs/msg/Quaternion": geometry_msgs_Quaternion;
  "geometry_msgs/msg/QuaternionStamped": geometry_msgs_QuaternionStamped;
  "geometry_msgs/msg/Transform": geometry_msgs_Transform;
  "geometry_msgs/msg/TransformStamped": geometry_msgs_TransformStamped;
  "geometry_msgs/msg/Twist": geometry_msgs_Twist;
  "geometry_msgs/msg/TwistStamped": geometry_msgs_TwistStamped;
  "geometry_msgs/msg/TwistWithCovariance": geometry_msgs_TwistWithCovariance;
  "geometry_msgs/msg/TwistWithCovarianceStamped": geometry_msgs_TwistWithCovarianceStamped;
  "geometry_msgs/msg/Vector3": geometry_msgs_Vector3;
  "geometry_msgs/msg/Vector3Stamped": geometry_msgs_Vector3Stamped;
  "geometry_msgs/msg/VelocityStamped": geometry_msgs_VelocityStamped;
  "geometry_msgs/msg/Wrench": geometry_msgs_Wrench;
  "geometry_msgs/msg/WrenchStamped": geometry_msgs_WrenchStamped;
  "mavros_msgs/msg/AttitudeTarget": mavros_msgs_AttitudeTarget;
  "mavros_msgs/msg/ExtendedState": mavros_msgs_ExtendedState;
  "mavros_msgs/msg/ParamValue": mavros_msgs_ParamValue;
  "mavros_msgs/msg/PositionTarget": mavros_msgs_PositionTarget;
  "mavros_msgs/msg/State": mavros_msgs_State;
  "mavros_msgs/msg/Waypoint": mavros_msgs_Waypoint;
  "mavros_msgs/msg/WaypointList": mavros_msgs_WaypointList;
  "nav_msgs/msg/GridCells": nav_msgs_GridCells;
  "nav_msgs/msg/MapMetaData": nav_msgs_MapMetaData;
  "nav_msgs/msg/OccupancyGrid": nav_msgs_OccupancyGrid;
  "nav_msgs/msg/Odometry": nav_msgs_Odometry;
  "nav_msgs/msg/Path": nav_msgs_Path;
  "octomap_msgs/msg/Octomap": octomap_msgs_Octomap;
  "octomap_msgs/msg/OctomapWithPose": octomap_msgs_OctomapWithPose;
  "rosapi_msgs/msg/TypeDef": rosapi_msgs_TypeDef;
  "rosgraph_msgs/msg/Clock": rosgraph_msgs_Clock;
  "sensor_msgs/msg/BatteryState": sensor_msgs_BatteryState;
  "sensor_msgs/msg/CameraInfo": sensor_msgs_CameraInfo;
  "sensor_msgs/msg/ChannelFloat32": sensor_msgs_ChannelFloat32;
  "sensor_msgs/msg/CompressedImage": sensor_msgs_CompressedImage;
  "sensor_msgs/msg/FluidPressure": sensor_msgs_FluidPressure;
  "sensor_msgs/msg/Illuminance": sensor_msgs_Illuminance;
  "sensor_msgs/msg/Image": sensor_msgs_Image;
  "sensor_msgs/msg/Imu": sensor_msgs_Imu;
  "sensor_msgs/msg/JointState": sensor_msgs_JointState;
  "sensor_msgs/msg/Joy": sensor_msgs_Joy;
  "sensor_msgs/msg/JoyFeedback": sensor_msgs_JoyFeedback;
  "sensor_msgs/msg/JoyFeedbackArray": sensor_msgs_JoyFeedbackArray;
  "sensor_msgs/msg/LaserEcho": sensor_msgs_LaserEcho;
  "sensor_msgs/msg/LaserScan": sensor_msgs_LaserScan;
  "sensor_msgs/msg/MagneticField": sensor_msgs_MagneticField;
  "sensor_msgs/msg/MultiDOFJointState": sensor_msgs_MultiDOFJointState;
  "sensor_msgs/msg/MultiEchoLaserScan": sensor_msgs_MultiEchoLaserScan;
  "sensor_msgs/msg/NavSatFix": sensor_msgs_NavSatFix;
  "sensor_msgs/msg/NavSatStatus": sensor_msgs_NavSatStatus;
  "sensor_msgs/msg/PointCloud": sensor_msgs_PointCloud;
  "sensor_msgs/msg/PointCloud2": sensor_msgs_PointCloud2;
  "sensor_msgs/msg/PointField": sensor_msgs_PointField;
  "sensor_msgs/msg/Range": sensor_msgs_Range;
  "sensor_msgs/msg/RegionOfInterest": sensor_msgs_RegionOfInterest;
  "sensor_msgs/msg/RelativeHumidity": sensor_msgs_RelativeHumidity;
  "sensor_msgs/msg/Temperature": sensor_msgs_Temperature;
  "sensor_msgs/msg/TimeReference": sensor_msgs_TimeReference;
  "simulation_interfaces/msg/Bounds": simulation_interfaces_Bounds;
  "simulation_interfaces/msg/EntityCategory": simulation_interfaces_EntityCategory;
  "simulation_interfaces/msg/EntityFilters": simulation_interfaces_EntityFilters;
  "simulation_interfaces/msg/EntityInfo": simulation_interfaces_EntityInfo;
  "simulation_interfaces/msg/EntityState": simulation_interfaces_EntityState;
  "simulation_interfaces/msg/NamedPose": simulation_interfaces_NamedPose;
  "simulation_interfaces/msg/Resource": simulation_interfaces_Resource;
  "simulation_interfaces/msg/Result": simulation_interfaces_Result;
  "simulation_interfaces/msg/SimulationState": simulation_interfaces_SimulationState;
  "simulation_interfaces/msg/SimulatorFeatures": simulation_interfaces_SimulatorFeatures;
  "simulation_interfaces/msg/SpawnEntity": simulation_interfaces_SpawnEntity;
  "simulation_interfaces/msg/SpawnResult": simulation_interfaces_SpawnResult;
  "simulation_interfaces/msg/Spawnable": simulation_interfaces_Spawnable;
  "simulation_interfaces/msg/TagsFilter": simulation_interfaces_TagsFilter;
  "simulation_interfaces/msg/WorldResource": simulation_interfaces_WorldResource;
  "std_msgs/msg/Bool": std_msgs_Bool;
  "std_msgs/msg/Byte": std_msgs_Byte;
  "std_msgs/msg/ByteMultiArray": std_msgs_ByteMultiArray;
  "std_msgs/msg/Char": std_msgs_Char;
  "std_msgs/msg/ColorRGBA": std_msgs_ColorRGBA;
  "std_msgs/msg/Empty": std_msgs_Empty;
  "std_msgs/msg/Float32": std_msgs_Float32;
  "std_msgs/msg/Float32MultiArray": std_msgs_Float32MultiArray;
  "std_msgs/msg/Float64": std_msgs_Float64;
  "std_msgs/msg/Float64MultiArray": std_msgs_Float64MultiArray;
  "std_msgs/msg/Header": std_msgs_Header;
  "std_msgs/msg/Int16": std_msgs_Int16;
  "std_msgs/msg/Int16MultiArray": std_msgs_Int16MultiArray;
  "std_msgs/msg/Int32": std_msgs_Int32;
  "std_msgs/msg/Int32MultiArray": std_msgs_Int32MultiArray;
  "std_msgs/msg/Int64": std_msgs_Int64;
  "std_msgs/msg/Int64MultiArray": std_msgs_Int64MultiArray;
  "std_msgs/msg/Int8": std_msgs_Int8;
  "std_msgs/msg/Int8MultiArray": std_msgs_Int8MultiArray;
  "std_msgs/msg/MultiArrayDimension": std_msgs_MultiArrayDimension;
  "std_msgs/msg/MultiArrayLayout": std_msgs_MultiArrayLayout;
  "std_msgs/msg/String": std_msgs_String;
  "std_msgs/msg/UInt16": std_msgs_UInt16;
  "std_msgs/msg/UInt16MultiArray": std_msgs_UInt16MultiArray;
  "std_msgs/msg/UInt32": std_msgs_UInt32;
  "std_msgs/msg/UInt32MultiArray": std_msgs_UInt32MultiArray;
  "std_msgs/msg/UInt64": std_msgs_UInt64;
  "std_msgs/msg/UInt64MultiArray": std_msgs_UInt64MultiArray;
  "std_msgs/msg/UInt8": std_msgs_UInt8;
  "std_msgs/msg/UInt8MultiArray": std_msgs_UInt8MultiArray;
  "tf2_msgs/msg/TF2Error": tf2_msgs_TF2Error;
  "tf2_msgs/msg/TFMessage": tf2_msgs_TFMessage;
  "trajectory_msgs/msg/JointTrajectory": trajectory_msgs_JointTrajectory;
  "trajectory_msgs/msg/JointTrajectoryPoint": trajectory_msgs_JointTrajectoryPoint;
  "trajectory_msgs/msg/MultiDOFJointTrajectory": trajectory_msgs_MultiDOFJointTrajectory;
  "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint": trajectory_msgs_MultiDOFJointTrajectoryPoint;
  "unique_identifier_msgs/msg/UUID": unique_identifier_msgs_UUID;
  "visualization_msgs/msg/ImageMarker": visualization_msgs_ImageMarker;
  "visualization_msgs/msg/InteractiveMarker": visualization_msgs_InteractiveMarker;
  "visualization_msgs/msg/InteractiveMarkerControl": visualization_msgs_InteractiveMarkerControl;
  "visualization_msgs/msg/InteractiveMarkerFeedback": visualization_msgs_InteractiveMarkerFeedback;
  "visualization_msgs/msg/InteractiveMarkerInit": visualization_msgs_InteractiveMarkerInit;
  "visualization_msgs/msg/InteractiveMarkerPose": visualization_msgs_InteractiveMarkerPose;
  "visualization_msgs/msg/InteractiveMarkerUpdate": visualization_msgs_InteractiveMarkerUpdate;
  "visualization_msgs/msg/Marker": visualization_msgs_Marker;
  "visualization_msgs/msg/MarkerArray": visualization_msgs_MarkerArray;
  "visualization_msgs/msg/MenuEntry": visualization_msgs_MenuEntry;
  "visualization_msgs/msg/MeshFile": visualization_msgs_MeshFile;
  "visualization_msgs/msg/UVCoordinate": visualization_msgs_UVCoordinate;
  "volery_interfaces/msg/CommandRecord": volery_interfaces_CommandRecord;
  "volery_interfaces/msg/FlightState": volery_interfaces_FlightState;
  "volery_interfaces/msg/Gust": volery_interfaces_Gust;
  "volery_interfaces/msg/MavlinkPackets": volery_interfaces_MavlinkPackets;
  "volery_interfaces/msg/MissionStatus": volery_interfaces_MissionStatus;
  "volery_interfaces/msg/PlayerState": volery_interfaces_PlayerState;
  "volery_interfaces/msg/SearchState": volery_interfaces_SearchState;
  "volery_interfaces/msg/SimulationStatus": volery_interfaces_SimulationStatus;
  "volery_interfaces/msg/Target": volery_interfaces_Target;
  "volery_interfaces/msg/Targets": volery_interfaces_Targets;
  "volery_interfaces/msg/TeamReport": volery_interfaces_TeamReport;
  "volery_interfaces/msg/VehicleState": volery_interfaces_VehicleState;
  "volery_interfaces/msg/VehicleStates": volery_interfaces_VehicleStates;
  "volery_interfaces/msg/Weather": volery_interfaces_Weather;
}

export interface Services {
  "mavros_msgs/srv/CommandBool": { request: mavros_msgs_CommandBool_Request; response: mavros_msgs_CommandBool_Response };
  "mavros_msgs/srv/CommandHome": { request: mavros_msgs_CommandHome_Request; response: mavros_msgs_CommandHome_Response };
  "mavros_msgs/srv/CommandLong": { request: mavros_msgs_CommandLong_Request; response: mavros_msgs_CommandLong_Response };
  "mavros_msgs/srv/CommandTOL": { request: mavros_msgs_CommandTOL_Request; response: mavros_msgs_CommandTOL_Response };
  "mavros_msgs/srv/ParamGet": { request: mavros_msgs_ParamGet_Request; response: mavros_msgs_ParamGet_Response };
  "mavros_msgs/srv/SetMode": { request: mavros_msgs_SetMode_Request; response: mavros_msgs_SetMode_Response };
  "mavros_msgs/srv/StreamRate": { request: mavros_msgs_StreamRate_Request; response: mavros_msgs_StreamRate_Response };
  "mavros_msgs/srv/WaypointClear": { request: mavros_msgs_WaypointClear_Request; response: mavros_msgs_WaypointClear_Response };
  "mavros_msgs/srv/WaypointPull": { request: mavros_msgs_WaypointPull_Request; response: mavros_msgs_WaypointPull_Response };
  "mavros_msgs/srv/WaypointPush": { request: mavros_msgs_WaypointPush_Request; response: mavros_msgs_WaypointPush_Response };
  "mavros_msgs/srv/WaypointSetCurrent": { request: mavros_msgs_WaypointSetCurrent_Request; response: mavros_msgs_WaypointSetCurrent_Response };
  "octomap_msgs/srv/BoundingBoxQuery": { request: octomap_msgs_BoundingBoxQuery_Request; response: octomap_msgs_BoundingBoxQuery_Response };
  "octomap_msgs/srv/GetOctomap": { request: octomap_msgs_GetOctomap_Request; response: octomap_msgs_GetOctomap_Response };
  "rosapi_msgs/srv/ActionType": { request: rosapi_msgs_ActionType_Request; response: rosapi_msgs_ActionType_Response };
  "rosapi_msgs/srv/DeleteParam": { request: rosapi_msgs_DeleteParam_Request; response: rosapi_msgs_DeleteParam_Response };
  "rosapi_msgs/srv/GetActionServers": { request: rosapi_msgs_GetActionServers_Request; response: rosapi_msgs_GetActionServers_Response };
  "rosapi_msgs/srv/GetParamNames": { request: rosapi_msgs_GetParamNames_Request; response: rosapi_msgs_GetParamNames_Response };
  "rosapi_msgs/srv/GetParam": { request: rosapi_msgs_GetParam_Request; response: rosapi_msgs_GetParam_Response };
  "rosapi_msgs/srv/GetROSVersion": { request: rosapi_msgs_GetROSVersion_Request; response: rosapi_msgs_GetROSVersion_Response };
  "rosapi_msgs/srv/GetTime": { request: rosapi_msgs_GetTime_Request; response: rosapi_msgs_GetTime_Response };
  "rosapi_msgs/srv/HasParam": { request: rosapi_msgs_HasParam_Request; response: rosapi_msgs_HasParam_Response };
  "rosapi_msgs/srv/Interfaces": { request: rosapi_msgs_Interfaces_Request; response: rosapi_msgs_Interfaces_Response };
  "rosapi_msgs/srv/MessageDetails": { request: rosapi_msgs_MessageDetails_Request; response: rosapi_msgs_MessageDetails_Response };
  "rosapi_msgs/srv/NodeDetails": { request: rosapi_msgs_NodeDetails_Request; response: rosapi_msgs_NodeDetails_Response };
  "rosapi_msgs/srv/Nodes": { request: rosapi_msgs_Nodes_Request; response: rosapi_msgs_Nodes_Response };
  "rosapi_msgs/srv/Publishers": { request: rosapi_msgs_Publishers_Request; response: rosapi_msgs_Publishers_Response };
  "rosapi_msgs/srv/SearchParam": { request: rosapi_msgs_SearchParam_Request; response: rosapi_msgs_SearchParam_Response };
  "rosapi_msgs/srv/ServiceHost": { request: rosapi_msgs_ServiceHost_Request; response: rosapi_msgs_ServiceHost_Response };
  "rosapi_msgs/srv/ServiceNode": { request: rosapi_msgs_ServiceNode_Request; response: rosapi_msgs_ServiceNode_Response };
  "rosapi_msgs/srv/ServiceProviders": { request: rosapi_msgs_ServiceProviders_Request; response: rosapi_msgs_ServiceProviders_Response };
  "rosapi_msgs/srv/ServiceRequestDetails": { request: rosapi_msgs_ServiceRequestDetails_Request; response: rosapi_msgs_ServiceRequestDetails_Response };
  "rosapi_msgs/srv/ServiceResponseDetails": { request: rosapi_msgs_ServiceResponseDetails_Request; response: rosapi_msgs_ServiceResponseDetails_Response };
  "rosapi_msgs/srv/ServiceType": { request: rosapi_msgs_ServiceType_Request; response: rosapi_msgs_ServiceType_Response };
  "rosapi_msgs/srv/ServicesForType": { request: rosapi_msgs_ServicesForType_Request; response: rosapi_msgs_ServicesForType_Response };
  "rosapi_msgs/srv/Services": { request: rosapi_msgs_Services_Request; response: rosapi_msgs_Services_Response };
  "rosapi_msgs/srv/SetParam": { request: rosapi_msgs_SetParam_Request; response: rosapi_msgs_SetParam_Response };
  "rosapi_msgs/srv/Subscribers": { request: rosapi_msgs_Subscribers_Request; response: rosapi_msgs_Subscribers_Response };
  "rosapi_msgs/srv/TopicType": { request: rosapi_msgs_TopicType_Request; response: rosapi_msgs_TopicType_Response };
  "rosapi_msgs/srv/TopicsAndRawTypes": { request: rosapi_msgs_TopicsAndRawTypes_Request; response: rosapi_msgs_TopicsAndRawTypes_Response };
  "rosapi_msgs/srv/TopicsForType": { request: rosapi_msgs_TopicsForType_Request; response: rosapi_msgs_TopicsForType_Response };
  "rosapi_msgs/srv/Topics": { request: rosapi_msgs_Topics_Request; response: rosapi_msgs_Topics_Response };
  "simulation_interfaces/srv/DeleteEntity": { request: simulation_interfaces_DeleteEntity_Request; response: simulation_interfaces_DeleteEntity_Response };
  "simulation_interfaces/srv/GetAvailableWorlds": { request: simulation_interfaces_GetAvailableWorlds_Request; response: simulation_interfaces_GetAvailableWorlds_Response };
  "simulation_interfaces/srv/GetCurrentWorld": { request: simulation_interfaces_GetCurrentWorld_Request; response: simulation_interfaces_GetCurrentWorld_Response };
  "simulation_interfaces/srv/GetEntitiesStates": { request: simulation_interfaces_GetEntitiesStates_Request; response: simulation_interfaces_GetEntitiesStates_Response };
  "simulation_interfaces/srv/GetEntities": { request: simulation_interfaces_GetEntities_Request; response: simulation_interfaces_GetEntities_Response };
  "simulation_interfaces/srv/GetEntityBounds": { request: simulation_interfaces_GetEntityBounds_Request; response: simulation_interfaces_GetEntityBounds_Response };
  "simulation_interfaces/srv/GetEntityInfo": { request: simulation_interfaces_GetEntityInfo_Request; response: simulation_interfaces_GetEntityInfo_Response };
  "simulation_interfaces/srv/GetEntityState": { request: simulation_interfaces_GetEntityState_Request; response: simulation_interfaces_GetEntityState_Response };
  "simulation_interfaces/srv/GetNamedPoseBounds": { request: simulation_interfaces_GetNamedPoseBounds_Request; response: simulation_interfaces_GetNamedPoseBounds_Response };
  "simulation_interfaces/srv/GetNamedPoses": { request: simulation_interfaces_GetNamedPoses_Request; response: simulation_interfaces_GetNamedPoses_Response };
  "simulation_interfaces/srv/GetSimulationState": { request: simulation_interfaces_GetSimulationState_Request; response: simulation_interfaces_GetSimulationState_Response };
  "simulation_interfaces/srv/GetSimulatorFeatures": { request: simulation_interfaces_GetSimulatorFeatures_Request; response: simulation_interfaces_GetSimulatorFeatures_Response };
  "simulation_interfaces/srv/GetSpawnables": { request: simulation_interfaces_GetSpawnables_Request; response: simulation_interfaces_GetSpawnables_Response };
  "simulation_interfaces/srv/LoadWorld": { request: simulation_interfaces_LoadWorld_Request; response: simulation_interfaces_LoadWorld_Response };
  "simulation_interfaces/srv/ResetSimulation": { request: simulation_interfaces_ResetSimulation_Request; response: simulation_interfaces_ResetSimulation_Response };
  "simulation_interfaces/srv/SetEntityInfo": { request: simulation_interfaces_SetEntityInfo_Request; response: simulation_interfaces_SetEntityInfo_Response };
  "simulation_interfaces/srv/SetEntityState": { request: simulation_interfaces_SetEntityState_Request; response: simulation_interfaces_SetEntityState_Response };
  "simulation_interfaces/srv/SetSimulationState": { request: simulation_interfaces_SetSimulationState_Request; response: simulation_interfaces_SetSimulationState_Response };
  "simulation_interfaces/srv/SpawnEntities": { request: simulation_interfaces_SpawnEntities_Request; response: simulation_interfaces_SpawnEntities_Response };
  "simulation_interfaces/srv/SpawnEntity": { request: simulation_interfaces_SpawnEntity_Request; response: simulation_interfaces_SpawnEntity_Response };
  "simulation_interfaces/srv/StepSimulation": { request: simulation_interfaces_StepSimulation_Request; response: simulation_interfaces_StepSimulation_Response };
  "simulation_interfaces/srv/UnloadWorld": { request: simulation_interfaces_UnloadWorld_Request; response: simulation_interfaces_UnloadWorld_Response };
  "std_srvs/srv/Empty": { request: std_srvs_Empty_Request; response: std_srvs_Empty_Response };
  "std_srvs/srv/SetBool": { request: std_srvs_SetBool_Request; response: std_srvs_SetBool_Response };
  "std_srvs/srv/Trigger": { request: std_srvs_Trigger_Request; response: std_srvs_Trigger_Response };
  "tf2_msgs/srv/FrameGraph": { request: tf2_msgs_FrameGraph_Request; response: tf2_msgs_FrameGraph_Response };
  "volery_interfaces/srv/ByName": { request: volery_interfaces_ByName_Request; response: volery_interfaces_ByName_Response };
  "volery_interfaces/srv/EndFault": { request: volery_interfaces_EndFault_Request; response: volery_interfaces_EndFault_Response };
  "volery_interfaces/srv/GetGridMap": { request: volery_interfaces_GetGridMap_Request; response: volery_interfaces_GetGridMap_Response };
  "volery_interfaces/srv/GetScenarioOptions": { request: volery_interfaces_GetScenarioOptions_Request; response: volery_interfaces_GetScenarioOptions_Response };
  "volery_interfaces/srv/GetVehicleInfo": { request: volery_interfaces_GetVehicleInfo_Request; response: volery_interfaces_GetVehicleInfo_Response };
  "volery_interfaces/srv/GetWeather": { request: volery_interfaces_GetWeather_Request; response: volery_interfaces_GetWeather_Response };
  "volery_interfaces/srv/GoTo": { request: volery_interfaces_GoTo_Request; response: volery_interfaces_GoTo_Response };
  "volery_interfaces/srv/Gust": { request: volery_interfaces_Gust_Request; response: volery_interfaces_Gust_Response };
  "volery_interfaces/srv/HandOver": { request: volery_interfaces_HandOver_Request; response: volery_interfaces_HandOver_Response };
  "volery_interfaces/srv/InjectFault": { request: volery_interfaces_InjectFault_Request; response: volery_interfaces_InjectFault_Response };
  "volery_interfaces/srv/JoinLockStep": { request: volery_interfaces_JoinLockStep_Request; response: volery_interfaces_JoinLockStep_Response };
  "volery_interfaces/srv/JoinSearch": { request: volery_interfaces_JoinSearch_Request; response: volery_interfaces_JoinSearch_Response };
  "volery_interfaces/srv/ListSnapshots": { request: volery_interfaces_ListSnapshots_Request; response: volery_interfaces_ListSnapshots_Response };
  "volery_interfaces/srv/LoadScenario": { request: volery_interfaces_LoadScenario_Request; response: volery_interfaces_LoadScenario_Response };
  "volery_interfaces/srv/PlayRecording": { request: volery_interfaces_PlayRecording_Request; response: volery_interfaces_PlayRecording_Response };
  "volery_interfaces/srv/PlayerInfo": { request: volery_interfaces_PlayerInfo_Request; response: volery_interfaces_PlayerInfo_Response };
  "volery_interfaces/srv/ReleaseControl": { request: volery_interfaces_ReleaseControl_Request; response: volery_interfaces_ReleaseControl_Response };
  "volery_interfaces/srv/Seek": { request: volery_interfaces_Seek_Request; response: volery_interfaces_Seek_Response };
  "volery_interfaces/srv/SetAttitudeTarget": { request: volery_interfaces_SetAttitudeTarget_Request; response: volery_interfaces_SetAttitudeTarget_Response };
  "volery_interfaces/srv/SetCommandTimeout": { request: volery_interfaces_SetCommandTimeout_Request; response: volery_interfaces_SetCommandTimeout_Response };
  "volery_interfaces/srv/SetGridMap": { request: volery_interfaces_SetGridMap_Request; response: volery_interfaces_SetGridMap_Response };
  "volery_interfaces/srv/SetLandingSpeed": { request: volery_interfaces_SetLandingSpeed_Request; response: volery_interfaces_SetLandingSpeed_Response };
  "volery_interfaces/srv/SetPositionTarget": { request: volery_interfaces_SetPositionTarget_Request; response: volery_interfaces_SetPositionTarget_Response };
  "volery_interfaces/srv/SetSpeed": { request: volery_interfaces_SetSpeed_Request; response: volery_interfaces_SetSpeed_Response };
  "volery_interfaces/srv/SetWeather": { request: volery_interfaces_SetWeather_Request; response: volery_interfaces_SetWeather_Response };
  "volery_interfaces/srv/StartRecording": { request: volery_interfaces_StartRecording_Request; response: volery_interfaces_StartRecording_Response };
  "volery_interfaces/srv/StopRecording": { request: volery_interfaces_StopRecording_Request; response: volery_interfaces_StopRecording_Response };
  "volery_interfaces/srv/TakeControl": { request: volery_interfaces_TakeControl_Request; response: volery_interfaces_TakeControl_Response };
  "volery_interfaces/srv/TakeOffTo": { request: volery_interfaces_TakeOffTo_Request; response: volery_interfaces_TakeOffTo_Response };
}
