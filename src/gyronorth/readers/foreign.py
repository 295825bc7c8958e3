"""Files that are known by their first bytes and are not read here: what each is, and how to get its numbers out."""

from __future__ import annotations

#: First bytes, what begins so, and what to do; {name} is the file's.
_FOREIGN: tuple[tuple[bytes, str, str], ...] = (
    (
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "an old Excel file (.xls)",
        "Save it in a spreadsheet program as .xlsx or .csv, or: libreoffice --headless --convert-to xlsx {name}",
    ),
    (
        b"TDSm",
        "a TDMS file of LabVIEW",
        "With Python's npTDMS: TdmsFile.read('{name}').as_dataframe().to_csv('imu.csv'), and read imu.csv",
    ),
    (b"CDF\x01", "a classic NetCDF file", "Convert it: nccopy -k nc4 {name} imu.nc, and read imu.nc"),
    (b"CDF\x02", "a classic NetCDF file", "Convert it: nccopy -k nc4 {name} imu.nc, and read imu.nc"),
    (b"CDF\x05", "a classic NetCDF file", "Convert it: nccopy -k nc4 {name} imu.nc, and read imu.nc"),
    (
        b"SQLite format 3\0",
        "a database of SQLite",
        "Write its table as text: sqlite3 {name} .tables lists them; sqlite3 -header -csv {name} 'select * from TABLE' "
        "> imu.csv, and read imu.csv",
    ),
    (
        b"ULog\x01\x12\x35",
        "a log of PX4 (.ulg)",
        "Write it as text with pyulog: ulog2csv -m sensor_combined {name}, and read the .csv that it writes",
    ),
    (
        b"\xa3\x95\x80",
        "a binary log of ArduPilot",
        "Write it as text with pymavlink: mavlogdump.py --types IMU --format csv {name} > imu.csv, and read imu.csv",
    ),
    (
        b"H Product:Blackbox",
        "a log of Betaflight or INAV",
        "Write it as text: blackbox_decode {name}, and read the .csv that it writes",
    ),
    (
        b"Obj\x01",
        "an Avro file",
        "Write it as JSON: avro-tools tojson {name} > imu.jsonl, and read imu.jsonl",
    ),
    (
        b"<?xml",
        "an XML file",
        "Write the numbers of its samples as text, one row each, by their names in it: xmlstarlet sel -t -m //SAMPLE "
        "-v @t -o , -v @gx -n {name} > imu.csv, and read imu.csv",
    ),
    *(
        (
            begin,
            "a capture of network packets",
            "Write what they carry as a file: tshark -r {name} -q -z follow,udp,raw,0 shows it; or tcpflow -r {name} "
            "for TCP, and read the file that it writes",
        )
        for begin in (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\x0a\x0d\x0d\x0a")
    ),
    (b"%PDF-", "a PDF", "Give the file with the numbers"),
    (b"\x89PNG\r\n", "a picture", "Give the file with the numbers"),
    (b"\xff\xd8\xff", "a picture", "Give the file with the numbers"),
    (b"Rar!\x1a\x07", "a RAR archive", "Unpack it first: unrar x {name}"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "Unpack it first: 7z x {name}"),
)
#: Where a tar archive has its name.
_TAR_AT, _TAR = 257, b"ustar"


def foreign(head: bytes, name: str) -> str | None:
    """What to say of a file that begins so; None for one that may be a recording."""
    if head[_TAR_AT : _TAR_AT + len(_TAR)] == _TAR:
        return f"{name} is a tar archive, which is not read. Unpack it first: tar xf {name}."
    for begin, what, cure in _FOREIGN:
        if head.startswith(begin):
            command = cure.format(name="FILE" if name == "standard input" else name)
            return f"{name} is {what}, which is not read. {command}."
    return None
