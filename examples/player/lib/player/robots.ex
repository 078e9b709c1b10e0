defmodule Player.Robots do
  @moduledoc """
  Chooses those sections of a configuration file that are of one robot: Player serves several at TCP ports of their own, and a robot
  may have several cameras, of which its blob finder takes one. Pure.
  """
  alias Player.{Addresses, Sections, State}

  # Where Player serves what names no port.
  @port 6665

  @doc """
  The sections of the robot with the first base, what is left out, and what was assumed; `kind` says what a section's driver is here
  (`:drive`, `:camera`, `:colours`, …), or `nil`.
  """
  @spec one([Sections.section()], (Sections.section() -> atom() | nil)) ::
          {[Sections.section()], left :: [State.remark()], assumed :: [State.remark()]}
  def one(sections, kind) do
    port = sections |> Enum.find(&(kind.(&1) == :drive)) |> port()
    other? = &(kind.(&1) != nil and port(&1) not in [nil, port])
    {others, own} = Enum.split_with(sections, other?)

    left =
      for section <- others do
        why = "is of the robot at port #{port(section)}; the one at port #{port} is imported"
        {section.line, "driver #{Sections.driver(section)}", why}
      end

    {own, unseen, assumed} = seen(own, kind)
    {own, left ++ unseen, assumed}
  end

  # What provides nothing is of any robot.
  defp port(section) do
    case Addresses.provided(section) do
      [] -> nil
      [%{robot: nil} | _more] -> @port
      [%{robot: port} | _more] -> port
    end
  end

  # The camera is that of the blob finder.
  defp seen(sections, kind) do
    cameras = for %{} = section <- sections, kind.(section) == :camera, do: section
    finder = Enum.find(sections, &(kind.(&1) == :colours))

    with %{} <- finder,
         {line, wanted} <- Addresses.required(finder),
         %{index: index} <- Enum.find(wanted, &(&1.interface == "camera")),
         true <- cameras != [] and Enum.all?(cameras, &(indices(&1) != [])) do
      of_finder(sections, cameras, index, line)
    else
      _not_said -> {sections, [], []}
    end
  end

  defp of_finder(sections, cameras, index, line) do
    {mine, others} = Enum.split_with(cameras, &(index in indices(&1)))

    if mine == [] do
      why =
        "no known driver provides camera:#{index}, so its pictures are taken for camera's of line"

      {sections, [], [{line, "requires", "#{why} #{hd(cameras).line}"}]}
    else
      why = "the blob finder looks at camera:#{index}"
      left = for camera <- others, do: {camera.line, "driver #{Sections.driver(camera)}", why}
      {sections -- others, left, []}
    end
  end

  defp indices(section),
    do: for(%{interface: "camera", index: index} <- Addresses.provided(section), do: index)
end
