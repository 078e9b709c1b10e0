defmodule Hal.Visca.Session do
  @moduledoc """
  Models a Sony EVI-D30, D31, D70 or D100 on its line, as a function of bytes, requests and time: what to write, and
  what the unit reports. Pure; `Hal.Visca.Driver` runs it.

  **Opening**: number the cameras, clear, ask for the model (`Hal.Visca.Model`), ask whether it is
  on (if not: switch it on), ask for the position. A camera that was switched off and on reports it in a
  chain, and is opened again; one that cannot execute a command is asked again whether it is on.
  After an opening the camera gets its last target again.

  **Ready**: the session asks for the position every `poll_ms`, and for the zoom every fifth time.

  **Positions** that the head cannot have reached are doubted (`Hal.Visca.Session.OutlierFilter`).

  **The target** is sent only when it changes. If the head stands still for half a second more
  than a degree away from it, it is sent again, once a second at most: a damaged command that the
  camera took for another one, or a hand, may have turned the head away.

  **What the camera refuses** is a reading, `{:refused, request, line}`, and what it has done,
  `{:obeyed, request}` (`Hal.Device.Obedience`).

  Effects: `{:write, bytes}`, `{:reading, reading}` (`Hal.Ptz`), and `{:error, reason}`, after
  which the session must be closed:

  | reason | when |
  |---|---|
  | `:no_answer` | nothing for 1 s, or no position for 2 s |
  | `{:cameras, n}` | the chain has fewer cameras than the requested number |
  | `{:address, n}` | only camera `n` answers, another one than the requested |
  | `{:model, code}` | a model whose units are not known; `nil`: it refuses to say its model |
  | `{:zoom, zoom, model}`, `{:position, pan, tilt, model}` | a camera of this model cannot have these |
  | `{:opening, step, refusal}` | the opening does not end within 9 s: the step, and what was refused last, or `nil` |
  """
  alias Hal.Visca.{Command, Decoder, Model, Queue, Reply, Units}
  alias Hal.Visca.Session.{OutlierFilter, Target}

  @lost_ms 2_000
  @zoom_each 5
  @on_ms 3_000
  # A device that gives no reading for 10 s is closed, and the reason would be lost.
  @opening_ms 9_000
  # A damaged message can look like a refusal, or like another number.
  @refusals 5
  @odd_zooms 3
  # At 9600 baud the answer with a position takes 11.5 ms, and its inquiry 5.2 ms.
  @answer_ms 11.5
  @question_ms 5.2

  @enforce_keys [:camera, :poll_ms, :decoder, :opening_ms]
  defstruct @enforce_keys ++
              [
                as: nil,
                model: nil,
                lens: nil,
                doubted: nil,
                refusals: 0,
                refused: nil,
                ours?: false,
                queue: Queue.new(),
                step: :address,
                look: nil,
                view: nil,
                target: nil,
                outliers: nil,
                zoom_wanted: nil,
                zoom: nil,
                odd_zooms: 0,
                odd: nil,
                position_ms: nil,
                poll_at_ms: nil,
                polls: 0
              ]

  @typedoc "The step of the opening."
  @type step :: :address | :clear | :version | :power | :switch_on | :look_round | :ready
  @opaque t :: %__MODULE__{}
  @type effect :: {:write, binary()} | {:reading, Hal.Ptz.reading()} | {:error, reason()}
  @type reason ::
          :no_answer
          | {:cameras, 0..7}
          | {:address, 1..7}
          | {:model, non_neg_integer() | nil}
          | {:zoom, non_neg_integer(), Model.key()}
          | {:position, integer(), integer(), Model.key()}
          | {:opening, step(), String.t() | nil}

  @doc """
  Starts the opening. Options: `camera` (1 to 7, default 1), `model` (`t:Hal.Visca.Model.key/0`,
  default: what it says), `lens` (`t:Hal.Visca.Units.lens/0`, default: the model's), `poll_ms`
  (default 100), `field_of_view` (radians to zoom to at the opening; default: leave it unchanged).

      iex> {effects, _head} = Hal.Visca.Session.open([], 0)
      iex> effects
      [{:write, <<0x88, 0x30, 0x01, 0xFF>>}]
  """
  @spec open(keyword(), integer()) :: {[effect()], t()}
  def open(options, now_ms) do
    defaults = [camera: 1, model: nil, lens: nil, poll_ms: 100, field_of_view: nil]
    options = Keyword.validate!(options, defaults)

    head = %__MODULE__{
      camera: options[:camera],
      as: options[:model],
      lens: options[:lens],
      poll_ms: options[:poll_ms],
      view: options[:field_of_view],
      decoder: Decoder.new(options[:camera]),
      opening_ms: now_ms
    }

    done(enter({[], head}, :address, now_ms))
  end

  @doc """
  Requests a direction (radians, left and up positive), at full speed; sent once the camera is
  open.
  """
  @spec look(t(), float(), float(), integer()) :: {[effect()], t()}
  def look(%__MODULE__{} = head, pan, tilt, now_ms),
    do: done(aim({[], wanted(%{head | look: {pan, tilt}})}, now_ms))

  defp wanted(%{model: nil} = head), do: head
  defp wanted(%{look: nil} = head), do: head

  defp wanted(%{look: {pan, tilt}, model: model} = head) do
    place = {Units.pan(pan, model), Units.tilt(tilt, model)}
    %{head | target: Target.want(head.target, place)}
  end

  @doc "Requests a horizontal field of view, in radians."
  @spec zoom(t(), float(), integer()) :: {[effect()], t()}
  def zoom(%__MODULE__{model: nil} = head, angle, _now_ms), do: {[], %{head | view: angle}}

  def zoom(%__MODULE__{} = head, angle, now_ms) do
    zoom = Units.zoom(angle, lens(head), head.model)
    head = %{head | view: angle}

    cond do
      zoom == head.zoom_wanted -> {[], head}
      head.step != :ready -> {[], %{head | zoom_wanted: zoom}}
      true -> done(push({[], %{head | zoom_wanted: zoom}}, {:zoom_to, zoom}, now_ms))
    end
  end

  defp lens(head), do: head.lens || head.model.lens

  @doc "How far the head can turn (`c:Hal.Ptz.reach/1`); `nil` while its model is not known."
  @spec reach(t()) :: Hal.Device.Obedience.reach()
  def reach(%__MODULE__{model: nil}), do: nil
  def reach(%__MODULE__{model: model}), do: Model.reach(model)

  @doc "Takes bytes from the line."
  @spec bytes(t(), binary(), integer()) :: {[effect()], t()}
  def bytes(%__MODULE__{} = head, bytes, now_ms) do
    {replies, decoder} = Decoder.feed(head.decoder, bytes)

    replies
    |> Enum.reduce({[], %{head | decoder: decoder}}, &reply(&1, &2, now_ms))
    |> late(now_ms)
    |> done()
  end

  defp reply(reply, {effects, head}, now_ms) do
    {more, queue} = Queue.heard(head.queue, reply, now_ms)
    # The answers to all are sent on by all cameras.
    ours? = head.ours? or not (match?({:cameras, _}, reply) or reply == :cleared)
    react({effects, %{head | queue: queue, ours?: ours?}}, more, now_ms)
  end

  @doc "Takes the time; needed at `wake_ms/1`, allowed at any time."
  @spec tick(t(), integer()) :: {[effect()], t()}
  def tick(%__MODULE__{} = head, now_ms) do
    {more, queue} = Queue.tick(head.queue, now_ms)
    {[], %{head | queue: queue}} |> react(more, now_ms) |> poll(now_ms) |> late(now_ms) |> done()
  end

  @doc "When `tick/2` is needed."
  @spec wake_ms(t()) :: integer() | nil
  def wake_ms(%__MODULE__{} = head) do
    [Queue.wake_ms(head.queue), head.poll_at_ms]
    |> Enum.filter(& &1)
    |> Enum.min(fn -> nil end)
  end

  # Opening

  # Whatever repeats itself in the opening, it must not do so for ever and in silence.
  defp late({effects, %{step: step} = head}, now_ms)
       when step != :ready and now_ms - head.opening_ms >= @opening_ms,
       do: {[{:error, head.odd || {:opening, step, head.refused}} | effects], head}

  defp late(state, _now_ms), do: state

  defp enter({effects, %{step: :ready} = head}, step, now_ms) when step != :ready,
    do: enter({effects, %{head | step: step, opening_ms: now_ms, refused: nil}}, step, now_ms)

  defp enter({effects, head}, :ready, now_ms),
    do: ask({effects, %{head | step: :ready}}, :ready, now_ms)

  # Polls only where a step starts it.
  defp enter({effects, head}, step, now_ms),
    do: ask({effects, %{head | step: step, poll_at_ms: nil}}, step, now_ms)

  defp ask(state, :address, now_ms), do: push(state, :address_set, now_ms)
  defp ask(state, :clear, now_ms), do: push(state, :if_clear, now_ms)
  defp ask(state, :version, now_ms), do: push(state, {:ask, :version}, now_ms)
  defp ask(state, :power, now_ms), do: push(state, {:ask, :power}, now_ms)

  # If the completion gets lost, the session asks whether the camera is on.
  defp ask({effects, head}, :switch_on, now_ms),
    do: push({effects, %{head | poll_at_ms: now_ms + @on_ms}}, {:power, true}, now_ms)

  defp ask({effects, head}, :look_round, now_ms),
    do: poll({effects, %{head | poll_at_ms: now_ms, position_ms: now_ms, polls: 0}}, now_ms)

  defp ask({effects, head}, :ready, now_ms) do
    state = aim({effects, %{head | target: Target.forget(head.target)}}, now_ms)
    if head.zoom_wanted, do: push(state, {:zoom_to, head.zoom_wanted}, now_ms), else: state
  end

  defp react(state, queue_effects, now_ms),
    do: Enum.reduce(queue_effects, state, &take(&1, &2, now_ms))

  defp take({:say, command}, {effects, head}, _now_ms),
    do: {[{:write, Command.encode(command, head.camera)} | effects], head}

  defp take(:no_answer, {effects, %{ours?: false, decoder: %{others: others}} = head}, _now_ms)
       when others > 1,
       do: {[{:error, {:address, head.decoder.other}} | effects], head}

  defp take(:no_answer, {effects, head}, _now_ms), do: {[{:error, :no_answer} | effects], head}

  defp take({:cameras, n}, {effects, %{camera: camera} = head}, _now_ms) when n < camera,
    do: {[{:error, {:cameras, n}} | effects], head}

  # Not every camera answers these; if something is wrong, a later step shows it.
  defp take({:cameras, _n}, {_, %{step: :address}} = state, now_ms),
    do: enter(state, :clear, now_ms)

  defp take({:failed, :address_set, _}, {_, %{step: :address}} = state, now_ms),
    do: enter(state, :clear, now_ms)

  defp take(:cleared, {_, %{step: :clear}} = state, now_ms), do: enter(state, :version, now_ms)

  defp take({:failed, :if_clear, _}, {_, %{step: :clear}} = state, now_ms),
    do: enter(state, :version, now_ms)

  defp take({:result, :version, %{model: code}, _}, {_, %{step: :version}} = state, now_ms),
    do: state |> recognise(code) |> known(now_ms)

  # One that is off may say its model when it is on.
  defp take({:result, :power, true, _}, {_, %{step: :power, model: nil}} = state, now_ms),
    do: enter(state, :version, now_ms)

  defp take({:result, :power, on?, _}, {_, %{step: :power}} = state, now_ms),
    do: enter(state, if(on?, do: :look_round, else: :switch_on), now_ms)

  defp take({:done, {:power, true}}, {_, %{step: :switch_on}} = state, now_ms),
    do: enter(state, :power, now_ms)

  defp take({:failed, {:power, true}, reason}, {_, %{step: :switch_on}} = state, now_ms),
    do: state |> refused({:power, true}, reason) |> enter(:power, now_ms)

  # Refused, but heard: the camera may be switched off.
  defp take({:failed, {:ask, :version}, reason}, {_, %{step: :version}} = state, now_ms)
       when reason not in [:no_answer, :malformed],
       do: state |> unsaid() |> known(now_ms)

  # Sent again until the camera answers, or is silent for a second.
  defp take({:failed, {:ask, inquiry}, reason}, {_, %{step: inquiry}} = state, now_ms),
    do: state |> refused({:ask, inquiry}, reason) |> enter(inquiry, now_ms)

  # Ready

  defp take({:result, :zoom, zoom, _}, {effects, %{model: %Model{zoom: most}} = head}, _now_ms) do
    cond do
      zoom <= most -> {effects, %{head | zoom: zoom, odd_zooms: 0}}
      head.odd_zooms + 1 < @odd_zooms -> {effects, %{head | odd_zooms: head.odd_zooms + 1}}
      true -> {[{:error, {:zoom, zoom, head.model.key}} | effects], head}
    end
  end

  defp take(
         {:result, :position, {pan, tilt} = at, took_ms},
         {effects, %{model: %Model{} = model} = head},
         now_ms
       ) do
    with true <- Units.position?(pan, tilt, model),
         {true, outliers} <- OutlierFilter.hear(head.outliers, at, now_ms) do
      target = Target.seen(head.target, at, now_ms)
      head = %{head | position_ms: now_ms, outliers: outliers, target: target, odd: nil}
      arrived({reading(effects, head, at, took_ms), head}, now_ms)
    else
      false -> {effects, %{head | odd: {:position, pan, tilt, model.key}}}
      {false, outliers} -> {effects, %{head | outliers: outliers}}
    end
  end

  defp take(:network_change, {effects, head}, now_ms),
    do: enter({effects, %{head | zoom: nil}}, :address, now_ms)

  # The camera may be switched off: the opening finds out.
  defp take({:failed, command, :not_executable}, {_, %{step: step}} = state, now_ms)
       when step in [:look_round, :ready],
       do: state |> refused(command, :not_executable) |> enter(:power, now_ms)

  defp take({:failed, command, reason}, state, _now_ms), do: refused(state, command, reason)

  defp take({:done, command}, {effects, head} = state, _now_ms) do
    case request(command) do
      nil -> state
      request -> {[{:reading, {:obeyed, request}} | effects], head}
    end
  end

  defp take(_else, state, _now_ms), do: state

  # The model

  # Damage can change the code: only what is said twice is refused.
  defp recognise({effects, %{as: as} = head}, code) do
    case {Model.of(code), as} do
      {{:ok, model}, nil} ->
        {effects, as_model(head, model)}

      {{:ok, %{key: as} = model}, as} ->
        {effects, as_model(head, model)}

      _other when code != head.doubted ->
        {effects, %{head | doubted: code}}

      {:error, nil} ->
        {[{:error, {:model, code}} | effects], head}

      {_another, as} ->
        model = Model.get(as)

        line =
          "it says that it is a camera #{Model.words(code)}, and is taken for an #{model.name}, because of model: " <>
            "in its file"

        {[{:reading, {:odd, line}} | effects], as_model(head, model)}
    end
  end

  defp unsaid({effects, %{as: as} = head}) when as != nil,
    do: {effects, as_model(head, Model.get(as))}

  defp unsaid({effects, %{refusals: refusals} = head}) when refusals + 1 >= @refusals,
    do: {[{:error, {:model, nil}} | effects], head}

  defp unsaid({effects, head}), do: {effects, %{head | refusals: head.refusals + 1}}

  # A camera that was switched on again may be another one.
  defp as_model(%{model: model} = head, model), do: head

  defp as_model(head, model) do
    head = %{head | model: model, target: Target.new(model), outliers: OutlierFilter.new(model)}
    zoom = if head.view, do: Units.zoom(head.view, lens(head), model)
    wanted(%{head | zoom_wanted: zoom, zoom: nil})
  end

  # Whether it is on is the next question, even to one that has not said its model.
  defp known({_, %{model: nil, doubted: code}} = state, now_ms) when code != nil,
    do: enter(state, :version, now_ms)

  defp known(state, now_ms), do: enter(state, :power, now_ms)

  # Refusals

  defp refused(state, _command, :cancelled), do: state

  defp refused({effects, head}, command, reason) do
    line = Reply.refusal(reason)

    case request(command) do
      nil -> {effects, %{head | refused: "#{asked(command)}: #{line}"}}
      request -> {[{:reading, {:refused, request, line}} | effects], %{head | refused: line}}
    end
  end

  defp request({:look, _, _, _, _}), do: :look
  defp request({:zoom_to, _}), do: :zoom
  defp request({:power, true}), do: :switch_on
  defp request(_command), do: nil

  defp asked({:ask, inquiry}), do: "the inquiry of its #{inquiry}"
  defp asked(command), do: inspect(command)

  defp arrived({effects, %{step: :look_round, zoom: zoom} = head}, now_ms) when zoom != nil,
    do: enter({effects, head}, :ready, now_ms)

  defp arrived(state, now_ms), do: aim(state, now_ms)

  defp reading(effects, %{zoom: nil}, _at, _took_ms), do: effects

  # The camera measures its direction between the last byte of the inquiry and the first of the
  # answer.
  defp reading(effects, head, {pan, tilt}, took_ms) do
    {pan, tilt} = Units.angles(pan, tilt, head.model)
    angle = Units.field_of_view(head.zoom, lens(head), head.model)
    age_ms = round((took_ms + @answer_ms - @question_ms) / 2)
    [{:reading, {:ptz, %{pan: pan, tilt: tilt, field_of_view: angle, age_ms: age_ms}}} | effects]
  end

  defp aim({effects, %{step: :ready} = head}, now_ms) do
    case Target.due(head.target, now_ms) do
      {{pan, tilt}, target} ->
        push({effects, %{head | target: target}}, {:look, pan, tilt, 24, 20}, now_ms)

      nil ->
        {effects, head}
    end
  end

  defp aim(state, _now_ms), do: state

  # Polling

  defp poll({_, %{step: :switch_on, poll_at_ms: at_ms}} = state, now_ms) when now_ms >= at_ms,
    do: enter(state, :power, now_ms)

  defp poll({effects, %{poll_at_ms: at_ms, position_ms: seen_ms} = head}, now_ms)
       when at_ms != nil and now_ms >= at_ms do
    if now_ms - seen_ms >= @lost_ms do
      {[{:error, head.odd || :no_answer} | effects], head}
    else
      # At absolute times; missed polls are not made up for.
      head = %{head | poll_at_ms: max(at_ms + head.poll_ms, now_ms + 1), polls: head.polls + 1}
      state = push({effects, head}, {:ask, :position}, now_ms)

      if head.zoom == nil or rem(head.polls, @zoom_each) == 0,
        do: push(state, {:ask, :zoom}, now_ms),
        else: state
    end
  end

  defp poll(state, _now_ms), do: state

  defp push({effects, head}, command, now_ms) do
    {more, queue} = Queue.push(head.queue, command, now_ms)
    react({effects, %{head | queue: queue}}, more, now_ms)
  end

  defp done({effects, head}), do: {Enum.reverse(effects), head}
end
