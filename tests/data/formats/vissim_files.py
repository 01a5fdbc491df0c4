"""Vehicle records in Vissim's layouts: link 1, connector 10000 and link 2 in sequence, and an off-ramp, link 77."""

from pathlib import Path

import numpy as np

STEP = 0.2  # s
LINKS = {1: 500.0, 10000: 12.0, 2: 400.0}  # lengths [m]
ENGLISH_COLUMNS = {
    "SIMSEC": "SimSec, Simulation second (Simulation time [s]) [s]",
    "NO": "No, Number (Unique vehicle number)",
    r"LANE\LINK\NO": r"Lane\Link\No, Link number (Unique number of the link or connector)",
    r"LANE\INDEX": r"Lane\Index, Index (Unique number of the lane)",
    "POS": "Pos, Position (Distance on the link from the beginning of the link or connector) [{length}]",
    "POSLAT": "PosLat, Position (lateral) (Lateral position in the lane)",
    "SPEED": "Speed, Speed (Speed at the end of the time step) [{speed}]",
    "VEHTYPE": "VehType, Vehicle type",
    "LENGTH": "Length, Length (Length of the vehicle) [{length}]",
}
GERMAN_COLUMNS = {
    "SIMSEK": "SimSek, Simulationssekunde (Simulationszeit [s]) [s]",
    "NR": "Nr, Nummer (Eindeutige Fahrzeugnummer)",
    r"FS\STRECKE\NR": r"Fs\Strecke\Nr, Nummer (Eindeutige Nummer der Strecke oder Verbindungsstrecke)",
    r"FS\INDEX": r"Fs\Index, Index (Eindeutige Nummer des Fahrstreifens)",
    "POS": "Pos, Position (Entfernung auf der Strecke vom Beginn der Strecke) [{length}]",
    "POSLAT": "PosLat, Position (lateral) (Seitliche Position im Fahrstreifen)",
    "GESCHW": "Geschw, Geschwindigkeit (Geschwindigkeit am Ende des Zeitschritts) [{speed}]",
    "FZTYP": "FzTyp, Fahrzeugtyp",
    "LÄNGE": "Länge, Länge (Länge des Fahrzeugs) [{length}]",
}
UNITS = {"m": 1.0, "ft": 0.3048, "km/h": 1.0 / 3.6, "mph": 0.44704, "m/s": 1.0}  # in SI units


def rows(n_vehicles: int = 7, n_steps: int = 300) -> list[list[float]]:
    """Rows of a vehicle record: time [s], vehicle, link, lane (1 is the rightmost), position of the front bumper on the
    link [m], lateral position as a share of the lane width (0.5 is the centre), speed [m/s], type, length [m].
    """
    records = []
    for step in range(n_steps):
        for i in range(n_vehicles):
            speeds = 20.0 + i % 3 + np.sin(0.05 * np.arange(step + 1) + i)
            start = 25 * i
            if step < start:
                continue
            # As in Vissim: the distance of a time step is the mean of the speeds at its ends, times its duration.
            distance = 8.0 + STEP * float(np.sum(0.5 * (speeds[start:-1] + speeds[start + 1 :])))
            link, begin = 1, 0.0
            for name, length in LINKS.items():
                if distance < begin + length:
                    link = name
                    break
                begin += length
            else:
                continue
            if i == 5 and link == 2:
                link = 77  # leaves by the off-ramp
            is_truck = i % 4 == 3
            length, kind, lane = (10.2, 200, 1) if is_truck else (4.4, 100, 1 + i % 2)
            records.append([STEP * (step + 1), i + 1, link, lane, distance - begin, 0.5, speeds[-1], kind, length])
    return records


def record_of(records: list[list[float]], length: str = "m", speed: str = "km/h") -> str:
    """The records as Vissim 6 and later write them, in the given units."""
    column_comments = [f"* {name}: {text.format(length=length, speed=speed)}" for name, text in ENGLISH_COLUMNS.items()]
    head = ["$VISION", r"* File: C:\Nets\A9.inpx", "* Comment: ", "* Date: 10.02.2025 11:42:03"]
    head += ["* Application: PTV Vissim 2025", "*", "* Table: Vehicles In Network", "*", *column_comments, "*", "*"]
    lines = [f"$VEHICLE:{';'.join(ENGLISH_COLUMNS)}"]
    for time, no, link, lane, pos, lateral, v, kind, size in records:
        numbers = (pos / UNITS[length], lateral, v / UNITS[speed], kind, size / UNITS[length])
        lines.append(f"{time:.2f};{no};{link};{lane};" + "{:.3f};{:.2f};{:.3f};{};{:.3f}".format(*numbers))
    return "\n".join([*head, *lines]) + "\n"


def german_record_of(records: list[list[float]], speed: str = "km/h", *, comma: bool = False) -> str:
    """The records as the German edition of Vissim 6 and later writes them, with decimal points or commas."""
    head, _, table = record_of(records, speed=speed).partition("$VEHICLE:")
    lines = [line for line in head.splitlines() if not line.startswith(tuple(f"* {name}:" for name in ENGLISH_COLUMNS))]
    column_comments = [f"* {name}: {text.format(length='m', speed=speed)}" for name, text in GERMAN_COLUMNS.items()]
    words = {"Table: Vehicles In Network": "Tabelle: Fahrzeuge im Netz", "File": "Datei", "Comment": "Kommentar"}
    above = "\n".join([*lines[:-2], *column_comments, *lines[-2:]])
    for english, german in {**words, "Date:": "Datum:", "Application": "Anwendung"}.items():
        above = above.replace(english, german)
    _, _, below = table.partition("\n")
    return f"{above}\n$FAHRZEUG:{';'.join(GERMAN_COLUMNS)}\n{below.replace('.', ',') if comma else below}"


def old_record_of(records: list[list[float]], speed: str = "km/h") -> str:
    """The records as VISSIM 5 wrote them: numbers padded with blanks, a semicolon also at the end of each line."""
    head = ["Vehicle Record", "", r"File:     c:\nets\a9.inp", "Comment:  ", "VISSIM:   5.30-05 [24]", ""]
    head += ["VehNr : Number of the Vehicle", f"v     : Speed [{speed}] at the end of the simulation step"]
    head += ["x     : Link coordinate [m] at the end of the simulation step", ""]
    lines = ["      t; VehNr; Link; Lane;       x;      v; Type; Length;"]
    for time, no, link, lane, pos, _, v, kind, size in records:
        numbers = f"{pos:8.2f};{v / UNITS[speed]:7.2f};{kind:5};{size:7.2f};"
        lines.append(f"{time:7.1f};{no:6};{link:5};{lane:5};{numbers}")
    return "\n".join([*head, *lines]) + "\n"


def write(folder: Path, text: str, name: str = "run_001.fzp") -> Path:
    """The folder, after the text has been written to a file in it."""
    (folder / name).write_text(text, encoding="utf-8")
    return folder
