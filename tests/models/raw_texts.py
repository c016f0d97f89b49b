"""Small RAW files of each revision with the same network: a unit, its transformer, a line to the grid."""

SECTIONS = {
    33: (
        "BUS", "LOAD", "FIXED SHUNT", "GENERATOR", "BRANCH", "TRANSFORMER", "AREA", "TWO-TERMINAL DC", "VSC DC LINE",
        "IMPEDANCE CORRECTION", "MULTI-TERMINAL DC", "MULTI-SECTION LINE", "ZONE", "INTER-AREA TRANSFER", "OWNER",
        "FACTS DEVICE", "SWITCHED SHUNT", "GNE DEVICE", "INDUCTION MACHINE",
    ),
}  # fmt: skip
SECTIONS[34] = tuple(
    two for one in SECTIONS[33] for two in ((one, "SYSTEM SWITCHING DEVICE") if one == "BRANCH" else (one,))
)
SECTIONS[35] = SECTIONS[34]

RATES = ",".join(["0.0"] * 12)
#: records of the network by revision; unit of 200 MVA at bus 1, recorded at bus 3, grid at bus 4
NETWORK = {
    "BUS": """\
 1,'UNIT, EAST  ',  20.0000,2,   1,   1,   1,1.02000,  10.0000
 2,'STATION',138.0,1,,,,1.01,5.0/ high-voltage side
 3, 'POINT' , 138.0000 ,1,1,1,1, 1.0 , 3.0,1.1,0.9,1.1,0.9
 4,'GRID',138.0,3,1,1,1,1.0,0.0""",
    "LOAD": " 1,'A',1,1,1,6.0,2.0,1.0,0.5,2.0,-1.0,1,1,0",
    "FIXED SHUNT": " 2,'1',1,0.0,10.0",
    "GENERATOR": {
        33: """\
 1,'1 ',150.0,20.0,80.0,-80.0,1.02,0,200.0,0.003,0.25,0.0,0.0,1.0,1,100.0,180.0,0.0,1,1.0
 4,'1 ',-140.0,10.0,,,1.0,0,100.0,0,0.00001""",
        35: """\
 1,'1 ',150.0,20.0,80.0,-80.0,1.02,0,0,200.0,0.003,0.25,0.0,0.0,1.0,1,100.0,180.0,0.0,0,1,1.0
 4,'1 ',-140.0,10.0,,,1.0,0,0,100.0,0,0.00001""",
    },
    "BRANCH": {
        33: """\
 2,3,'1 ',0.005,0.04,0.06,250.0,250.0,250.0,0.001,0.002,0.0,0.0,1,1,0.0,1,1.0
 3,4,'1 ',0.01,0.1,0.1""",
        34: f"""\
 2,3,'1 ',0.005,0.04,0.06,'LINE / NORTH',{RATES},0.001,0.002,0.0,0.0,1,1,0.0,1,1.0
 3,4,'1 ',0.01,0.1,0.1""",
    },
    "TRANSFORMER": {
        33: """\
 2,1,0,'T1',1,2,1,0.0005,-0.004,2,'STEP-UP',1,1,1.0
 0.003,0.13,220.0
 1.05,0.0,30.0,220.0,220.0,220.0,0,0,1.1,0.9,1.1,0.9,33,0,0.0,0.0,0.0
 1.01,0.0""",
        34: f"""\
 2,1,0,'T1',1,2,1,0.0005,-0.004,2,'STEP-UP',1,1,1.0,,,,,,,'YNd1',0
 0.003,0.13,220.0
 1.05,0.0,30.0,{RATES},0,0,1.1,0.9,1.1,0.9,33,0,0.0,0.0,0.0
 1.01,0.0""",
        35: f"""\
 2,1,0,'T1',1,2,1,0.0005,-0.004,2,'STEP-UP',1,1,1.0,,,,,,,'YNd1',0
 0.003,0.13,220.0
 1.05,0.0,30.0,{RATES},0,0,0,1.1,0.9,1.1,0.9,33,0,0.0,0.0,0.0
 1.01,0.0""",
    },
    "SWITCHED SHUNT": {
        33: " 2,1,0,1,1.05,0.95,0,100.0,'',-5.0,1,-5.0",
        35: " 2,'1',1,0,1,1.05,0.95,0,0,100.0,'',-5.0,1,1,-5.0\n 3,'2',0,0,1,1.05,0.95,0,0,100.0,'',-5.0,1,1,-5.0",
    },
}


def raw_text(revision=33, **changes):
    """RAW file of a revision; ``BUS="..."`` replaces the records of a section."""
    lines = [] if revision == 33 else ["@!IC,SBASE,REV,XFRRAT,NXFRAT,BASFRQ"]
    lines += [
        f" 0, 100.00, {revision}, 0, 1, 60.00  / a comment, with commas",
        " TITLE 'ONE",
        " 0, TITLE / TWO",
    ]
    names = SECTIONS[revision]
    if revision > 33:
        lines += ["GENERAL, THRSHZ=0.0001, PQBRAK=0.7", 'RATING, 1, "RATE1 ", "RATING SET 1"']
        lines += ["0 / END OF SYSTEM-WIDE DATA, BEGIN BUS DATA"]
    for name, following in zip(names, (*names[1:], ""), strict=True):
        records = changes.get(name.replace(" ", "_"), NETWORK.get(name, ""))
        if isinstance(records, dict):
            records = records[max(since for since in records if since <= revision)]
        if revision > 33:
            lines.append(f"@! headings of the {name} data, 'with a quote")
        lines += [
            *records.splitlines(),
            f" 0 / END OF {name} DATA" + (f", BEGIN {following} DATA" if following else ""),
        ]
    return "\n".join([*lines, "Q", ""])
