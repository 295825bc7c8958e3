"""Names under which files of arrays hold angular rate, specific force, time, and the rate as one number."""

#: Names of arrays without case, digits at the end and what is no letter or digit.
GYRO_ARRAYS = frozenset(
    ("gyro", "gyr", "gyros", "gyroscope", "gyroscopes", "wb", "wibb", "w", "omega", "omegab", "omegaibb", "angvel",
     "angularvelocity", "angularrate", "angularrates", "angrate", "turnrate", "imugyro", "gyrodata", "gyrob",
     "rotationrate")
)  # fmt: skip
ACCEL_ARRAYS = frozenset(
    ("accel", "acc", "accels", "accelerometer", "accelerometers", "acceleration", "accelerations", "acce", "fb", "fibb",
     "f", "a", "ab", "specificforce", "specforce", "linacc", "linearacceleration", "imuaccel", "imuacc", "acceldata",
     "accdata", "accelb", "accb")
)  # fmt: skip
TIME_ARRAYS = frozenset(
    (
        "t",
        "time",
        "times",
        "timestamp",
        "timestamps",
        "stamp",
        "stamps",
        "tb",
        "timu",
        "imut",
        "imutime",
        "seconds",
        "ts",
        "tstamp",
    )
)
#: Scalars that hold the rate, Hz, and the interval, s.
RATE_SCALARS, INTERVAL_SCALARS = (
    frozenset(("freq", "fs", "rate", "ratehz", "samplerate", "freqhz")),
    frozenset(("ts", "dt")),
)
