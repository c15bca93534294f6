"""Nodes of program files of our own making, in the forms that PolyScope gives them, and the script they become.

Each sample is (nodes of a program that runs once, its script without the first and the last line). The label of
the main program, number 1, stands before all that a sample shows, or where the sample shows it.
"""

from dashboard_support import expression, external_control, script_line

JOINTS = "0.1, -1.5, 1.2, -1.0, -1.5, 0.0"
POSE = "0.25, -0.1, 0.3, 0.0, 3.0, 0.5"
POSE_TEXT = "p[.250000000000, -.100000000000, .300000000000, .000000000000, 3.000000000000, .500000000000]"
BASE = '<feature class="GeomFeatureReference" referencedName="Joint_0_name"/>'
TOOL = '<feature class="GeomFeatureReference" referencedName="Joint_6_name"/>'
POSITION = f'<position joints="{JOINTS}" pose="{POSE}"/>'
ANGLES = f'<position><JointAngles angles="{JOINTS}"/></position>'
FASTER = '<motionParameters jointSpeed="2.0" jointAcceleration="3.0" cartesianSpeed="0.5" cartesianAcceleration="1.5"'


def move(kind, nodes, attributes='useActiveTCP="true"', feature=BASE):
    return f'<Move motionType="{kind}" speed="0.25" acceleration="1.2" {attributes}>{feature}<children>{nodes}</children></Move>'


def waypoint(name="W", inside=f"<motionParameters/>{POSITION}", kind="Fixed"):
    return f'<Waypoint type="{kind}" name="{name}" kinematicsFlags="4">{inside}</Waypoint>'


def variable_waypoint(name):
    return f'<Waypoint type="Variable" name="Waypoint" kinematicsFlags="1"><motionParameters/><variable name="{name}"/></Waypoint>'


def pin(name):
    return f'<pin referencedName="{name}"/>'


def assignment(name, text):
    return f'<Assignment valueSource="Expression"><variable name="{name}"/>{expression(text)}</Assignment>'


def branch(kind, nodes="", condition="", *, watched=False):
    inside = expression(condition) if condition else "<expression/>"
    return f'<If type="{kind}" checkContinuously="{str(watched).lower()}">{inside}<children>{nodes}</children></If>'


def direction(untils, attributes='selectedDirection="ZMinus" toolParams="0.1, 0.8"', inside=""):
    tag = "gui.program.direction.MoveDirectionNode"
    return f"<{tag} {attributes}>{inside}<children>{untils}</children></{tag}>"


def until_distance(distance, nodes=""):
    return (
        f'<Until type="DISTANCE" deceleration="1.2" distanceNodeType="STOP" allowActions="{str(bool(nodes)).lower()}">'
        f'<Distance>{distance}</Distance><motionParameters blendRadius="0.0"/><children>{nodes}</children></Until>'
    )


CONTACT = '<Until type="TOOL_CONTACT_DETECTION" retraction="0.02" decelerationAcceleration="3.0" allowActions="false"/>'
HALT = "<Halt/>"
INVERSE = f"get_inverse_kin({POSE_TEXT}, qnear=[{JOINTS}])"
POINT = """\
  def calculate_point_to_move_towards(feature, direction, position_distance):
    local goal=get_target_waypoint()
    local axis=[direction[0], direction[1], direction[2]]
    if (norm(axis) < 1e-6):
      return goal
    end
    local unit=normalize(axis)
    local d=position_distance
    local step=p[unit[0]*d, unit[1]*d, unit[2]*d, 0, 0, 0]
    local turned=pose_trans(p[0, 0, 0, feature[3], feature[4], feature[5]], step)
    return p[goal[0]+turned[0], goal[1]+turned[1], goal[2]+turned[2], goal[3], goal[4], goal[5]]
  end
  $ 1 "Robot Program\""""

SAMPLES = {
    "SafeHome": ('<SafeHome positionOptionType="SPEED_AND_ACCELERATION" speed="1.0" acceleration="1.4"/>', """
  $ 2 "Home"
  movej([0.0, -1.5707963267948966, 0.0, -1.5707963267948966, 0.0, 0.0], a=1.4, v=1.0)
"""),
    "Assignment": (assignment("part", "1 + 2"), """
  $ 2 "part≔1 + 2"
  global part=1 + 2
"""),
    "Assignment by reference": (
        assignment("part", "1 + 2") + '<Assignment valueSource="Expression"><variable reference="../../Assignment/variable"/>'
        '<expression><ExpressionVariable><ProgramVariable reference="../../../../Assignment[1]/variable"/></ExpressionVariable>'
        '<ExpressionChar character="≤"/><ExpressionToken token=" True "/></expression></Assignment>', """
  $ 2 "part≔1 + 2"
  global part=1 + 2
  $ 3 "part≔part≤ True "
  global part=part <=   True  
"""),
    "Assignment by the operator": (
        '<Assignment valueSource="Operator" valueType="Integer" message="how &quot;many&quot;?"><variable name="part"/></Assignment>', """
  $ 2 "part≔Operator"
  global part=request_integer_from_primary_client("how 'many'?")
"""),
    "CallSubProgram": (
        f'<CallSubProgram><subprogram name="pick" keepHidden="false"><children>{HALT}</children></subprogram></CallSubProgram>'
        '<CallSubProgram><subprogram reference="../../CallSubProgram/subprogram"/></CallSubProgram>', """
  def pick():
    $ 4 "pick" "noBreak"
    $ 5 "Halt"
    halt
  end
  $ 1 "Robot Program"
  $ 2 "Call pick"
  pick()
  $ 3 "Call pick"
  pick()
"""),
    "CircleMove": (
        move("MoveP", waypoint() + f'<CircleMove OrientationMode="FIXED"><children>{waypoint("Via")}{variable_waypoint("Home")}'
             f"</children></CircleMove>{waypoint()}", 'blendRadius="0.025"'), f"""
  $ 2 "MoveP"
  $ 3 "W" "breakAfter"
  movep({POSE_TEXT}, a=1.2, v=0.25, r=0.025)
  $ 4 "CircleMove"
  $ 5 "Via" "noBreak"
  $ 6 "Home" "breakAfter"
  movec({POSE_TEXT}, Home, a=1.2, v=0.25, r=0.025, mode=1)
  $ 7 "W" "breakAfter"
  movep({POSE_TEXT}, a=1.2, v=0.25, r=0.0)
"""),
    "Comment": ('<Comment comment="the &quot;first&quot;&#10;part"/><Comment/>', """
  $ 2 "'the 'first' part'"
  # 'the "first" part'
  $ 3 "Comment"
  # Comment
"""),
    "Contributed": (external_control(), """
  # begin: URCap Program Node
  #   Source: External Control
  #   Type: External Control
  $ 2 "Control by External Control"
  # gap
  # end: URCap Program Node
"""),
    "Folder": (f'<Folder name="Set up" keepHidden="true"><children>{assignment("part", "3")}</children></Folder>', """
  $ 2 "Set up"
  $ 3 "part≔3"
  global part=3
"""),
    "Force": (
        f'<Force type="Frame">{TOOL}<selection value="0, 0, 1, 0, 0, 0"/><wrench value="0.0, 0.0, 20.0, 0.0, 0.0, 0.0"/>'
        '<limitsForce value="0.15, 0.15, 0.15, 0.3, 0.3, 0.3"/><limitsMotion value="0.05, 0.06, 0.07, 0.2, 0.2, 0.2"/>'
        f'<children>{script_line("sync()")}</children></Force>', """
  $ 2 "Force"
  sleep(0.02)
  zero_ftsensor()
  force_mode(tool_pose(), [0, 0, 1, 0, 0, 0], [0.0, 0.0, 20.0, 0.0, 0.0, 0.0], 2, [0.05, 0.06, 0.15, 0.2, 0.2, 0.2])
  $ 3 "sync()" "noBreak"
  sync()
  end_force_mode()
  stopl(5.0)
"""),
    "Halt": (HALT, """
  $ 2 "Halt"
  halt
"""),
    "If": (branch("If", HALT, "1 ≟ 2"), """
  $ 2 "If 1 ≟ 2"
  if (1  ==  2):
    $ 3 "Halt"
    halt
  end
"""),
    "If with ElseIf and Else": (
        branch("If", HALT, "1 ≠ 2") + "<SuppressedNode><suppressedNode class='If' type='ElseIf'><children/></suppressedNode></SuppressedNode>"
        f'<If type="ElseIf" checkContinuously="false"><expression><ExpressionIO>{pin("config_in[3]")}</ExpressionIO></expression><children/></If>'
        + branch("Else", script_line("sync()")) + HALT, """
  $ 2 "If 1 ≠ 2"
  if (1  !=  2):
    $ 3 "Halt"
    halt
  else:
    $ 5 "ElseIf CI[3]"
    if (get_configurable_digital_in(3)):
    else:
      $ 6 "Else" "noBreak"
      $ 7 "sync()"
      sync()
    end
  end
  $ 8 "Halt"
  halt
"""),
    "If that is watched": (
        branch("If", script_line("sync()"), "1≟1", watched=True) + branch("Else", HALT), """
  $ 2 "If 1≟1"
  global thread_flag_2=0
  thread Thread_if_2():
    $ 3 "sync()"
    sync()
    thread_flag_2 = 1
  end
  if (1 == 1):
    global thread_handler_2=run Thread_if_2()
    while (thread_flag_2 == 0):
      if not(1 == 1):
        kill thread_handler_2
        thread_flag_2 = 2
      else:
        sync()
      end
    end
  else:
    thread_flag_2 = 2
  end
  if (thread_flag_2 == 2):
    $ 4 "Else" "noBreak"
    $ 5 "Halt"
    halt
  end
"""),
    "Loop": (f'<Loop type="Forever"><children>{HALT}</children></Loop>', """
  $ 2 "Loop"
  while (True):
    $ 3 "Halt"
    halt
  end
"""),
    "Loop that counts": (
        f'<Loop type="Counting" count="3"><loopVariable name="Loop_1"/><children>{HALT}</children></Loop>'
        '<Loop type="Counting" count="2"><loopVariable reference="../../Loop/loopVariable"/><children/></Loop>', """
  $ 2 "Loop 3 times"
  Loop_1 = 0
  while (Loop_1 < 3):
    $ 3 "Halt"
    halt
    Loop_1 = Loop_1 + 1
  end
  $ 4 "Loop 2 times"
  Loop_1 = 0
  while (Loop_1 < 2):
    Loop_1 = Loop_1 + 1
  end
"""),
    "Loop on a condition": (f'<Loop type="While" checkContinuously="false">{expression("1 ≤ 2")}<children/></Loop>', """
  $ 2 "Loop 1 ≤ 2"
  while (1  <=  2):
  end
"""),
    "Loop that is watched": (
        f'<Loop type="While" checkContinuously="true">{expression("2 ≥ 1")}<children>{script_line("sync()")}</children></Loop>', """
  $ 2 "Loop 2 ≥ 1"
  thread Thread_while_2():
    while (True):
      $ 3 "sync()"
      sync()
    end
  end
  if (2  >=  1):
    global thread_handler_2=run Thread_while_2()
    while (2  >=  1):
      sync()
    end
    kill thread_handler_2
  end
"""),
    "Move": (move("MoveJ", waypoint()), f"""
  $ 2 "MoveJ"
  $ 3 "W" "breakAfter"
  movej({INVERSE}, a=1.2, v=0.25)
"""),
    "Move in joint space": (move("MoveJ", waypoint(), 'useActiveTCP="false"', ""), f"""
  $ 2 "MoveJ"
  $ 3 "W" "breakAfter"
  movej([{JOINTS}], a=1.2, v=0.25)
"""),
    "Move in a line": (move("MoveL", waypoint() + HALT + waypoint("V")), f"""
  $ 2 "MoveL"
  $ 3 "W" "breakAfter"
  movel({POSE_TEXT}, a=1.2, v=0.25)
  $ 4 "Halt"
  halt
  $ 5 "V" "breakAfter"
  movel({POSE_TEXT}, a=1.2, v=0.25)
"""),
    "Move of a process": (
        move("MoveP", waypoint() + waypoint("V", f'<motionParameters blendRadius="0.01"/>{POSITION}') + waypoint(), 'blendRadius="0.02"')
        + move("MoveL", waypoint()), f"""
  $ 2 "MoveP"
  $ 3 "W" "breakAfter"
  movep({POSE_TEXT}, a=1.2, v=0.25, r=0.02)
  $ 4 "V" "breakAfter"
  movep({POSE_TEXT}, a=1.2, v=0.25, r=0.01)
  $ 5 "W" "breakAfter"
  movep({POSE_TEXT}, a=1.2, v=0.25, r=0.0)
  $ 6 "MoveL"
  $ 7 "W" "breakAfter"
  movel({POSE_TEXT}, a=1.2, v=0.25)
"""),
    "Move in a move": (move("MoveL", move("MoveJ", variable_waypoint("a")) + variable_waypoint("b")), """
  $ 2 "MoveL"
  $ 3 "MoveJ"
  $ 4 "a" "breakAfter"
  movej(a, a=1.2, v=0.25)
  $ 5 "b" "breakAfter"
  movel(b, a=1.2, v=0.25)
"""),
    "Placeholder": ("<Placeholder/>", """
"""),
    "Popup": (
        '<Popup type="Message" haltProgram="false" message="say &quot;ok&quot;"/>'
        '<Popup type="Error" haltProgram="true" inputType="Text" message="no part"/>', """
  $ 2 "Popup: say 'ok'"
  popup("say 'ok'", "Message", False, False, blocking=True)
  $ 3 "Popup: no part"
  popup("no part", "Error", False, True, blocking=False)
  halt
"""),
    "Popup of a value": (
        '<Popup type="Warning" haltProgram="false" inputType="Variable"><variable name="part"/></Popup>'
        f'<Popup type="Message" haltProgram="false" inputType="Expression">{expression("1+2")}</Popup>', """
  $ 2 "Popup"
  popup(str_cat("",part), "Warning", True, False, blocking=True)
  $ 3 "Popup"
  popup(str_cat("",1+2), "Message", False, False, blocking=True)
"""),
    "Script": (script_line('textmsg("a")'), """
  $ 2 "textmsg('a')"
  textmsg("a")
"""),
    "Script in a lost file": (
        '<Loop type="Forever"><children><Script type="File"><cachedContents>x = 1\ntextmsg(x)\n</cachedContents>'
        '<file resolves-to="file">/programs/cell/gone.script</file></Script></children></Loop>', """
  $ 2 "Loop"
  while (True):
    $ 3 "Script: gone.script"
    x = 1
    textmsg(x)
  end
"""),
    "Set": (
        f'<Set type="DigitalOutput">{pin("digital_out[2]")}<digitalValue>1</digitalValue></Set>'
        f'<Set type="DigitalOutput">{pin("tool_out[1]")}<digitalValue>0</digitalValue></Set>'
        '<Set type="DigitalOutput"><pin reference="../../Set/pin"/><digitalValue>0</digitalValue></Set>'
        f'<Set type="DigitalOutput">{pin("config_out[7]")}<digitalValue>1</digitalValue></Set><Set type="NoAction"/>', """
  $ 2 "Set DO[2]=On"
  set_standard_digital_out(2, True)
  $ 3 "Set TO[1]=Off"
  set_tool_digital_out(1, False)
  $ 4 "Set DO[2]=Off"
  set_standard_digital_out(2, False)
  $ 5 "Set CO[7]=On"
  set_configurable_digital_out(7, True)
  $ 6 "Set"
"""),
    "SuppressedNode": (
        "<SuppressedNode><suppressedNode class='Folder'><children><PalletWizard/></children></suppressedNode></SuppressedNode>" + HALT, """
  $ 4 "Halt"
  halt
"""),
    "Switch": (
        f'<Switch>{expression("2")}<children><Case caseValue="1"><children>{HALT}</children></Case><Case caseValue="2147483647">'
        f'<children>{script_line("sync()")}</children></Case><Case caseValue="2"><children/></Case></children></Switch>', """
  $ 2 "Switch 2"
  switch_1 = 2
  $ 3 "Case 1"
  if (1 == switch_1):
    $ 4 "Halt"
    halt
  elif (2 == switch_1):
    $ 7 "Case 2"
  else:
    $ 5 "Default Case"
    $ 6 "sync()"
    sync()
  end
"""),
    "Switch without cases": (f"<Switch>{expression('2')}<children/></Switch>", """
  $ 2 "Switch 2"
  switch_1 = 2
"""),
    "Timer": (
        '<Timer action="Reset"><variable name="t"/></Timer><Timer action="Start"><variable name="t"/></Timer>'
        '<Timer action="Stop"><variable name="t"/></Timer>', """
  global t=0
  global t_is_counting=False
  thread Timer_Thread():
    while (True):
      if (t_is_counting):
        t = t + get_steptime()
      end
      sync()
    end
  end
  run Timer_Thread()
  $ 1 "Robot Program"
  $ 2 "t: Reset"
  t = 0
  $ 3 "t: Start"
  t_is_counting = True
  $ 4 "t: Stop"
  t_is_counting = False
"""),
    "Wait": ('<Wait type="Sleep"><waitTime>0.22</waitTime></Wait><Wait type="NoWait"/>', """
  $ 2 "Wait: 0.22"
  sleep(0.22)
  $ 3 "Wait: 0"
"""),
    "Wait for a line": (
        f'<Wait type="DigitalInput">{pin("digital_in[0]")}<digitalValue>1</digitalValue></Wait>'
        f'<Wait type="DigitalInput">{pin("tool_in[1]")}<digitalValue>0</digitalValue></Wait>', """
  $ 2 "Wait DI[0]=HI"
  while (get_standard_digital_in(0) == False):
    sync()
  end
  $ 3 "Wait TI[1]=LO"
  while (get_tool_digital_in(1) == True):
    sync()
  end
"""),
    "Wait for a level": (
        f'<Wait type="AnalogInput">{pin("analog_in[2]")}<analogComparison>1</analogComparison><analogValue>4.0</analogValue></Wait>', """
  $ 2 "Wait AI[2]>4.0"
  while (not(get_tool_analog_in(0) > 4.0)):
    sync()
  end
"""),
    "Wait for a condition": (f'<Wait type="Condition">{expression("1 ≟ 1")}</Wait>', """
  $ 2 "Wait 1 ≟ 1"
  while (not(1  ==  1)):
    sync()
  end
"""),
    "Waypoint": (
        move("MoveJ", waypoint("W", f"{FASTER}/>{POSITION}") + waypoint("W", f'<motionParameters nextMotionTime="3.5"/>{POSITION}'))
        + move("MoveL", waypoint("W", f'{FASTER} blendRadius="0.01"/>{POSITION}')), f"""
  $ 2 "MoveJ"
  $ 3 "W" "breakAfter"
  movej({INVERSE}, a=3.0, v=2.0)
  $ 4 "W" "breakAfter"
  movej({INVERSE}, t=3.5)
  $ 5 "MoveL"
  $ 6 "W" "breakAfter"
  movel({POSE_TEXT}, a=1.5, v=0.5, r=0.01)
"""),
    "Waypoint that has only angles": (move("MoveL", waypoint("W", f"<motionParameters/>{ANGLES}")), f"""
  $ 2 "MoveL"
  $ 3 "W" "breakAfter"
  movel([{JOINTS}], a=1.2, v=0.25)
"""),
    "Waypoint by reference": (
        move("MoveL", waypoint() + '<Waypoint reference="../Waypoint"/>'), f"""
  $ 2 "MoveL"
  $ 3 "W" "breakAfter"
  movel({POSE_TEXT}, a=1.2, v=0.25)
  $ 4 "W" "breakAfter"
  movel({POSE_TEXT}, a=1.2, v=0.25)
"""),
    "Waypoint in an expression": (
        move("MoveL", waypoint()) + '<Assignment><variable name="a"/><expression><ExpressionWaypoint><Waypoint referenceName="W" '
        'reference="../../../../Move/children/Waypoint"/></ExpressionWaypoint></expression></Assignment>', f"""
  $ 2 "MoveL"
  $ 3 "W" "breakAfter"
  movel({POSE_TEXT}, a=1.2, v=0.25)
  $ 4 "a≔W"
  global a={POSE_TEXT}
"""),
    "gui.program.direction.MoveDirectionNode": (move("MoveL", direction(until_distance("0.15", HALT) + CONTACT)), POINT + """
  $ 2 "MoveL"
  $ 3 "Direction: Base Z-"
  global move_thread_flag_3=0
  thread move_thread_3():
    enter_critical
    move_thread_flag_3 = 1
    local towardsPos=calculate_point_to_move_towards(p[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0], 0.15)
    movel(towardsPos, a=0.8, v=0.1)
    move_thread_flag_3 = 2
    exit_critical
  end
  move_thread_flag_3 = 0
  move_thread_han_3 = run move_thread_3()
  while (True):
    local targetTcpDirection=get_target_tcp_speed()
    local stepsToRetract=tool_contact(direction=targetTcpDirection)
    if (stepsToRetract > 0):
      kill move_thread_han_3
      stopl(3.0)
      local contactPose=get_forward_kin(get_actual_joint_positions_history(stepsToRetract))
      local axis=[targetTcpDirection[0], targetTcpDirection[1], targetTcpDirection[2]]
      local retractTo=contactPose
      if (norm(axis) > 1e-6):
        local unit=normalize(axis)
        retractTo = pose_sub(contactPose, p[unit[0]*0.02, unit[1]*0.02, unit[2]*0.02, 0, 0, 0])
      end
      movel(retractTo, a=3.0, v=0.1)
      $ 6 "Until (tool_contact_detection)"
      break
    end
    sleep(1.0E-10)
    if (move_thread_flag_3 > 1):
      join move_thread_han_3
      $ 4 "Until (distance)"
      $ 5 "Halt"
      halt
      break
    end
    sync()
  end
"""),
    "Direction of a vector": (
        move("MoveL", direction(until_distance("0.2"), "", f'{TOOL}{expression("[1,0,1]")}')), POINT + """
  $ 2 "MoveL"
  $ 3 "Direction: Tool"
  global move_thread_flag_3=0
  thread move_thread_3():
    enter_critical
    move_thread_flag_3 = 1
    local towardsPos=calculate_point_to_move_towards(get_forward_kin(), [1,0,1], 0.2)
    movel(towardsPos, a=1.2, v=0.25)
    move_thread_flag_3 = 2
    exit_critical
  end
  move_thread_flag_3 = 0
  move_thread_han_3 = run move_thread_3()
  while (True):
    sleep(1.0E-10)
    if (move_thread_flag_3 > 1):
      join move_thread_han_3
      $ 4 "Until (distance)"
      break
    end
    sync()
  end
"""),
}  # fmt: skip
